# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
One message that is filled from the bytes of the newest, and the bytes of one that is filled in.

rclpy makes a message of Python objects, each with its parts twice, of all that it takes, and looks
at every part of what it publishes. Here the middleware does so once; messages after it that
differ in numbers only are unpacked into the first one, or packed as that was.
"""

from __future__ import annotations

import array
from operator import itemgetter
import struct
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message

#: CDR, little-endian: the only encoding that is unpacked here.
LITTLE_ENDIAN = b'\x00\x01'
#: The encapsulation; alignment counts from its end.
HEAD = 4
#: Of the length of a text or a sequence.
WORD = 4
#: For `struct`, of the types of fields.
CODES = {
    'boolean': '?',
    'int8': 'b',
    'uint8': 'B',
    'int16': 'h',
    'uint16': 'H',
    'int32': 'i',
    'uint32': 'I',
    'int64': 'q',
    'uint64': 'Q',
    'float': 'f',
    'double': 'd',
}


class KeptMessage:
    """
    Reads messages of a kind.

    :param kind: type of the messages.
    """

    def __init__(self, kind: type) -> None:
        self._kind = kind
        self._layout: _Layout | None = None

    def read(self, data: bytes) -> Any:
        """
        Return the message, valid until the next call; None where the bytes are none.

        :param data: as the middleware received it.
        """
        if self._layout is not None and self._layout.fill(data):
            return self._layout.message
        try:
            message = deserialize_message(data, self._kind)
        except rclpy_implementation.RMWError:
            return None
        layout = _Layout(message)
        self._layout = layout if layout.begin(data) else None
        return message


class KeptBytes:
    """
    Turns a message that is filled in anew each time into bytes, to be published.

    :param message: the message; its parts stay the same objects.
    """

    def __init__(self, message: Any) -> None:
        self._message = message
        self._layout: _Layout | None = None

    def pack(self) -> Any:
        """Return the bytes of the message as it is; itself where its type has no layout."""
        if self._layout is None or not self._layout.is_current():
            self._layout = _Layout(self._message)
        return self._layout.pack()


class _Layout:
    """
    Where the numbers of a message are, with these texts and as many numbers in each sequence.

    :ivar message: the message.
    :param message: of any type; one with fields of unknown types has no layout.
    """

    def __init__(self, message: Any) -> None:
        self.message = message
        self._known = True
        self._format, self._size = f'<2s{HEAD - 2}x', 0
        self._texts: list[tuple[int, bytes]] = [(0, LITTLE_ENDIAN)]
        self._numbers: list[tuple[int, Any, str]] = []
        self._sequences: list[tuple[int, Any, str]] = []
        self._strings: list[tuple[Any, str, Any]] = []
        self._lengths: list[tuple[Any, str, int]] = []
        self._count = 1
        self._add_fields(message)
        places, expected = zip(*self._texts, strict=True)
        self._struct = struct.Struct(self._format)
        self._select = itemgetter(*places, places[0])  # at least two: a tuple
        self._expected = (*expected, expected[0])
        self._length = 0
        self._values: list[Any] = [None] * self._count
        for place, text in self._texts:
            self._values[place] = text

    def begin(self, data: bytes) -> bool:
        """
        Return whether the bytes of the message are laid out so; `fill` takes others like them.

        :param data: from which the middleware has read it.
        """
        self._length = len(data)
        if not self._known or self._length < self._struct.size:
            return False
        return self._matches(self._struct.unpack_from(data))

    def fill(self, data: bytes) -> bool:
        """
        Fill the message and return True, where the bytes differ in numbers only.

        :param data: of a message of the same type.
        """
        if len(data) != self._length:
            return False
        values = self._struct.unpack_from(data)
        if not self._matches(values):
            return False
        for place, part, name in self._numbers:
            setattr(part, name, values[place])
        for place, part, name in self._sequences:
            setattr(part, name, array.array('d', values[place]))
        return True

    def is_current(self) -> bool:
        """Return whether the message has the same texts, and as many numbers, as it had."""
        return all(getattr(part, name) == text for part, name, text in self._strings) and all(
            len(getattr(part, name)) == length for part, name, length in self._lengths
        )

    def pack(self) -> Any:
        """Return the bytes of the message; itself where it has no layout."""
        if not self._known:
            return self.message
        values = self._values
        for place, part, name in self._numbers:
            values[place] = getattr(part, name)
        for place, part, name in self._sequences:
            values[place] = getattr(part, name).tobytes()
        return self._struct.pack(*values)

    def _matches(self, values: tuple[Any, ...]) -> bool:
        return self._select(values) == self._expected

    def _add_fields(self, part: Any) -> None:
        for name, kind in part.get_fields_and_field_types().items():
            value = getattr(part, name)
            if kind in CODES:
                self._numbers.append((self._count, part, name))
                self._add(CODES[kind], struct.calcsize(f'<{CODES[kind]}'))
            elif kind == 'string':
                self._strings.append((part, name, value))
                self._add_text(value)
            elif kind == 'sequence<string>':
                self._strings.append((part, name, list(value)))
                self._add_length(len(value))
                for text in value:
                    self._add_text(text)
            elif kind == 'sequence<double>' or (kind.startswith('sequence<') and not value):
                self._lengths.append((part, name, len(value)))
                self._add_length(len(value))
                if value:  # nothing is aligned for none
                    self._sequences.append((self._count, part, name))
                    self._add(f'{8 * len(value)}s', 8, len(value))
            elif hasattr(value, 'get_fields_and_field_types'):
                self._add_fields(value)
            else:
                self._known = False

    def _add_text(self, text: str) -> None:
        data = text.encode() + b'\x00'
        data = struct.pack('<I', len(data)) + data
        self._texts.append((self._count, data))
        self._add(f'{len(data)}s', WORD, 0)
        self._size += len(data)

    def _add_length(self, length: int) -> None:
        self._texts.append((self._count, struct.pack('<I', length)))
        self._add(f'{WORD}s', WORD)

    def _add(self, code: str, size: int, count: int = 1) -> None:
        """Add a value whose place is a multiple of its size."""
        padding = -self._size % size
        self._format += f'{padding}x{code}'
        self._size += padding + count * size
        self._count += 1
