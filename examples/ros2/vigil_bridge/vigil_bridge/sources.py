"""Where a channel comes from, as a parameter says it: `joint_states 0.5*velocity[front] + 0.5*velocity[rear]`.

First the topic, then paths in its messages, each with a factor if it needs one, and numbers that are added.
"""

import math
import re

from .fields import resolve, steps_of
from .misfit import Misfit

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
# An element's name may hold blanks and signs: it lies between brackets.
PATH = r"[A-Za-z_](?:[\w.]|\[[^\]]+\])*"
TERM = re.compile(rf"\s*([+-]?)\s*(?:({NUMBER})\s*\*\s*({PATH})|({PATH})|({NUMBER}))\s*")


class Source:
    """A topic, and the sum of paths in its messages, each with a factor, and of a number."""

    def __init__(self, name, text):
        topic, _, rest = text.strip().partition(" ")
        self.topic, self.terms, self.offset, self._columns = topic, [], 0.0, {}
        at = 0
        while at < len(rest):
            term = TERM.match(rest, at)
            # All but the first begin with a sign.
            if term is None or (at > 0 and not term[1]):
                break
            at = term.end()
            sign, factor, path = (-1.0 if term[1] == "-" else 1.0), float(term[2] or 1.0), term[3] or term[4]
            if path is None:
                self.offset += sign * float(term[5])
            else:
                steps_of(path)
                self.terms.append((sign * factor, path))
        if at < len(rest) or not self.terms:
            raise Misfit(f"'{name}' is '{text}': write a topic and a path, such as 'odom twist.twist.linear.x'")

    def find(self, message):
        """The columns of its paths in the type of `message`; found once for each type."""
        columns = self._columns.get(type(message))
        if columns is None:
            columns = [(factor, resolve(message, path)) for factor, path in self.terms]
            self._columns[type(message)] = columns
        return columns

    def value(self, message):
        """The value in a message, None for what it does not have; NaN for what it says is not known."""
        total = self.offset
        for factor, column in self.find(message):
            value = column.value(message)
            if value is None:
                return None
            total += factor * value
        return total if math.isfinite(total) else math.nan
