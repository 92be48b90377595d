"""What a message of any type of ROS 2 is made of."""

import dataclasses
import numbers

from .misfit import Misfit

# Numbers of a message that an error lists.
LISTED_MAX = 40


def fields(message):
    """Names of its fields, in their order; none for what is no message."""
    of_ros = getattr(type(message), "get_fields_and_field_types", None)
    if of_ros is not None:
        return list(of_ros())
    # The classes of other libraries, whose own fields begin with `_`.
    own = dataclasses.fields(message) if dataclasses.is_dataclass(message) else ()
    return [field.name for field in own if not field.name.startswith("_")]


def is_list(value):
    return not isinstance(value, (str, bytes)) and hasattr(value, "__len__") and hasattr(value, "__getitem__")


def is_names(value):
    """True for a list of strings, as joints have."""
    return is_list(value) and len(value) > 0 and all(isinstance(one, str) for one in value)


def number(value):
    """A number; None for what is none. A string that is a number is read as one, as in diagnostics."""
    if isinstance(value, bytes) and len(value) == 1:
        # The type `byte`.
        return float(value[0])
    if isinstance(value, (str, numbers.Real)):
        try:
            return float(value)
        except ValueError:
            return None
    return None


def numbers_of(message, before=""):
    """Paths of the numbers that it has, as far as an error lists them."""
    found = []
    for name in fields(message):
        value, path = getattr(message, name), before + name
        if fields(value):
            found += numbers_of(value, path + ".")
        elif is_list(value):
            found += [] if is_names(value) else [f"{path}[...]"]
        elif number(value) is not None:
            found.append(path)
    return found[:LISTED_MAX]


def class_of(type_name):
    """The class of `nav_msgs/msg/Odometry`."""
    import importlib

    package, _, name = type_name.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name.rpartition("/")[2])
    except (ImportError, AttributeError):
        raise Misfit(f"type '{type_name}' is not installed: source its package")
