# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Reads trace.pftrace, as far as tests of the program need it: names of tracks and events, and their arguments.

Field numbers are those of perfetto/protos/perfetto/trace/perfetto_trace.proto.
"""
import zlib


def varint(data, at):
    value, shift = 0, 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def fields(data):
    """Yields (number, value) of a message; bytes for what has a length."""
    at = 0
    while at < len(data):
        tag, at = varint(data, at)
        kind = tag & 7
        if kind == 0:
            value, at = varint(data, at)
        elif kind == 1:
            value, at = int.from_bytes(data[at:at + 8], "little"), at + 8
        elif kind == 2:
            length, at = varint(data, at)
            value, at = data[at:at + length], at + length
            assert len(value) == length, "the file is cut"
        else:
            raise AssertionError(f"wire type {kind}")
        yield tag >> 3, value


def packets(data):
    for number, packet in fields(data):
        assert number == 1
        content = list(fields(packet))
        if content[0][0] == 50:  # compressed
            yield from packets(zlib.decompress(content[0][1]))
        else:
            yield content


class Picture:
    def __init__(self, path):
        self.tracks = {}
        self.events = []  # (track, type, name, arguments)
        for packet in packets(path.read_bytes()):
            for number, value in packet:
                if number == 60:
                    its = dict(fields(value))
                    self.tracks[its[1]] = its.get(2, b"").decode()
                if number == 11:
                    its = dict(fields(value))
                    arguments = {}
                    for field, annotation in fields(value):
                        if field == 4:
                            one = dict(fields(annotation))
                            name = one.pop(10).decode()
                            (kind, what), = one.items()
                            arguments[name] = what.decode() if kind == 6 else what
                    name = its[23].decode() if 23 in its else None
                    self.events.append((self.tracks[its[11]], its[9], name, arguments))

    @property
    def run(self):
        """The arguments of the event that states what the run was."""
        return next(arguments for _, _, name, arguments in self.events if name == "run")
