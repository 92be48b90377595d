"""The ROS 2 package installs as any package of Python, and its launch file says what the node understands."""

import importlib.util
import pathlib
import runpy
import shutil
import subprocess
import sys
import tempfile
import types
import unittest
import xml.etree.ElementTree
from unittest import mock

from harness import EXAMPLES, WATCHDOG_S
from ros_stand_in import PACKAGES

PACKAGE = EXAMPLES / "ros2" / "vigil_bridge"


class Package(unittest.TestCase):
    def installed(self, folder, follows_links):
        """A copy, as in a workspace, installed beside it."""
        source, target = pathlib.Path(folder) / "source", pathlib.Path(folder) / "target"
        shutil.copytree(PACKAGE, source, symlinks=not follows_links)
        command = [sys.executable, "setup.py", "--quiet", "build", "--build-lib", target]
        command += ["install_data", "--install-dir", target]
        if importlib.util.find_spec("setuptools") is None:
            # From Python 3.12 on; pip gets it from where it gets packages.
            command = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-compile", "--quiet"]
            command += ["--target", target, source]
        return target, subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=WATCHDOG_S)

    def test_it_installs_with_the_files_that_it_links_to(self):
        with tempfile.TemporaryDirectory() as folder:
            target, done = self.installed(folder, follows_links=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            for name in ["vigil_types.py", "sending.py", "waiting.py"]:
                file = target / "vigil_bridge" / "wire" / name
                self.assertFalse(file.is_symlink())
                self.assertEqual(file.read_text(), (EXAMPLES / name).read_text())
            own = {file.name for file in (PACKAGE / "vigil_bridge").glob("*.py")}
            self.assertEqual({file.name for file in (target / "vigil_bridge").glob("*.py")}, own)
            share = target / "share" / "vigil_bridge"
            names = sorted(str(file.relative_to(share)) for file in share.rglob("*") if file.is_file())
            files = ["config/differential.yaml", "config/rover.yaml", "launch/bridge.launch.py", "package.xml"]
            self.assertEqual(names, files)
            self.assertTrue((target / "share/ament_index/resource_index/packages/vigil_bridge").is_file())
            # What is without ROS runs from there; the plain names do not stay in the path.
            code = "import sys; before = list(sys.path); from vigil_bridge import frames, report, wire\n"
            code += "print(wire.SocketPublisher.__module__, wire.vigil_types.__file__, sys.path == before)"
            command = [sys.executable, "-c", code]
            done = subprocess.run(command, cwd=target, env={"PYTHONPATH": str(target)}, capture_output=True, text=True)
            self.assertEqual(done.stdout.split(), ["sending", f"{target}/vigil_bridge/wire/vigil_types.py", "True"])

    def test_a_copy_without_what_its_links_lead_to_says_so(self):
        with tempfile.TemporaryDirectory() as folder:
            _, done = self.installed(folder, follows_links=False)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("vigil_types.py leads nowhere: copy the package with 'cp -rL'", done.stderr)

    def test_its_manifest_names_the_packages_that_it_needs(self):
        manifest = xml.etree.ElementTree.parse(PACKAGE / "package.xml").getroot()
        self.assertEqual(manifest.findtext("name"), "vigil_bridge")
        self.assertEqual(manifest.findtext("export/build_type"), "ament_python")
        needed = {depend.text for depend in manifest.findall("exec_depend")}
        self.assertEqual(needed, {"rclpy", "ros2launch", *PACKAGES})


class Made:
    """Something of a launch file: keeps what it was made with."""

    def __init__(self, *words, **named):
        self.words, self.named = words, named


def launch_file():
    """The launch file, run with a stand-in for launch."""
    modules = {}
    for name, things in {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "OpaqueFunction"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
        "ament_index_python": [],
        "ament_index_python.packages": [],
    }.items():
        modules[name] = types.ModuleType(name)
        vars(modules[name]).update({thing: type(thing, (Made,), {}) for thing in things})
    modules["ament_index_python.packages"].get_package_share_directory = lambda name: str(PACKAGE)
    with mock.patch.dict(sys.modules, modules):
        return runpy.run_path(str(PACKAGE / "launch" / "bridge.launch.py"))


class Launch(unittest.TestCase):
    def node(self, **given):
        """What the node is started with."""
        file = launch_file()
        (*arguments, function) = file["generate_launch_description"]().words[0]
        defaults = {argument.words[0]: argument.named["default_value"] for argument in arguments}
        self.assertEqual(set(given) - set(defaults), set())
        context = types.SimpleNamespace(launch_configurations={**defaults, **given})
        (node,) = function.named["function"](context)
        return defaults, node.named

    def test_what_is_not_given_stays_as_the_file_of_parameters_has_it(self):
        defaults, node = self.node()
        self.assertEqual(node["parameters"][1], {})
        self.assertEqual(pathlib.Path(defaults["params_file"]), PACKAGE / "config" / "rover.yaml")
        self.assertTrue(pathlib.Path(defaults["params_file"]).is_file())
        self.assertEqual((node["package"], node["executable"]), ("vigil_bridge", "bridge"))

    def test_what_is_given_is_a_parameter_of_the_node_with_its_type(self):
        from vigil_bridge.settings import DEFAULTS

        _, node = self.node(graph="7", channel_list="a.channels", obey="false")
        kinds = {name: value.named["value_type"] for name, value in node["parameters"][1].items()}
        self.assertEqual(kinds, {name: type(DEFAULTS[name]) for name in ("graph", "channel_list", "obey")})
        self.assertEqual([name for name, _ in node["remappings"]], ["cmd_vel_in", "cmd_vel_out"])


if __name__ == "__main__":
    unittest.main()
