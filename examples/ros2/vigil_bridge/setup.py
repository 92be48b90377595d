from glob import glob
from pathlib import Path

from setuptools import setup

NAME = "vigil_bridge"
# Links into Vigil's `examples`. Without their targets they would silently be left out.
for name in ["vigil_types.py", "sending.py", "waiting.py"]:
    link = Path(__file__).parent / NAME / "wire" / name
    if not link.is_file():
        raise SystemExit(f"{link} leads nowhere: copy the package with 'cp -rL', which follows links")

setup(
    name=NAME,
    version="0.1.0",
    description="Sends a robot's messages to Vigil as frames; publishes Vigil's verdicts, and obeys them.",
    license="MIT OR Apache-2.0",
    maintainer="Vigil",
    maintainer_email="vigil@example.com",
    packages=[NAME, f"{NAME}.wire"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*.yaml")),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    entry_points={"console_scripts": [f"bridge = {NAME}.node:main"]},
)
