# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Writes recordings in the Common Trace Format, as ros2_tracing and the kernel's tracer fill them. See imports.py."""
import struct

MAGIC = 0xC1FC1FC1
UUIDS = ("0eb8d02e-6c95-40b4-9b9e-6b9e2d1f600c", "1eb8d02e-6c95-40b4-9b9e-6b9e2d1f600c")
CLOCKS = {"monotonic": "189cba56-b9e4-46f1-bf67-8792bdf5f9cd", "other": "289cba56-b9e4-46f1-bf67-8792bdf5f9cd"}


def metadata(kinds, is_kernel, clock):
    """`kinds` is {event: (id, {field: value of an event})}: the fields have the types of these values."""
    def field(name, value):
        return f"string {name};" if isinstance(value, str) else f"int64_t {name};"
    context = "" if is_kernel else "event.context := struct { int32_t vpid; int32_t vtid; string procname; };"
    events = "".join(f'event {{ name = "{name}"; id = {number}; stream_id = 0; fields := struct {{ '
                     f'{" ".join(field(*each) for each in fields.items())} }}; }};\n'
                     for name, (number, fields) in kinds.items())
    return f"""/* CTF 1.8 */
typealias integer {{ size = 32; align = 8; signed = false; }} := uint32_t;
typealias integer {{ size = 32; align = 8; signed = true; }} := int32_t;
typealias integer {{ size = 64; align = 8; signed = false; }} := uint64_t;
typealias integer {{ size = 64; align = 8; signed = true; }} := int64_t;
trace {{ major = 1; minor = 8; uuid = "{UUIDS[is_kernel]}"; byte_order = le;
  packet.header := struct {{ uint32_t magic; uint32_t stream_id; }}; }};
clock {{ name = {clock}; uuid = "{CLOCKS[clock]}"; freq = 1000000000; offset = 0; }};
typealias integer {{ size = 64; align = 8; signed = false; map = clock.{clock}.value; }} := time_t;
stream {{ id = 0; event.header := struct {{ uint32_t id; time_t timestamp; }}; {context}
  packet.context := struct {{ time_t timestamp_begin; time_t timestamp_end; uint64_t content_size; uint64_t packet_size;
    uint64_t events_discarded; }}; }};
{events}"""


def packet(events, discarded):
    """Returns a packet of encoded events: (time, bytes)."""
    content = b"".join(encoded for _, encoded in events)
    size = 8 * (8 + 40 + len(content))
    begin, end = events[0][0], events[-1][0]
    return struct.pack("<IIQQQQQ", MAGIC, 0, begin, end, size, size, discarded) + content


def write_trace(folder, events, is_kernel=False, clock="monotonic", packets=((None, 0),)):
    """Writes events (time, name, process, thread, {field: value}). `packets` are (events, discarded events so far)."""
    folder.mkdir(parents=True)
    kinds = {}
    encoded = []
    for time, name, process, thread, fields in sorted(events, key=lambda event: event[0]):
        number, _ = kinds.setdefault(name, (len(kinds), fields))
        data = struct.pack("<IQ", number, time)
        if not is_kernel:
            data += struct.pack("<ii", process, thread) + b"robot\0"
        for value in fields.values():
            data += value.encode() + b"\0" if isinstance(value, str) else struct.pack("<q", value)
        encoded.append((time, data))
    (folder / "metadata").write_text(metadata(kinds, is_kernel, clock))
    content = b""
    for count, discarded in packets:
        content += packet(encoded[:count], discarded)
        encoded = encoded[count:] if count else []
    (folder / "channel0_0").write_bytes(content)


class Robot:
    """Events of nodes, as ros2_tracing records them."""

    def __init__(self, process=1, first=1000):
        self.events = []
        self.process = process
        self.next = first
        self.now = 0
        self.thread = process

    def add(self, name, **fields):
        self.events.append((self.now, "ros2:" + name, self.process, self.thread, fields))

    def handle(self):
        self.next += 1
        return self.next

    def node(self, name):
        handle = self.handle()
        self.add("rcl_node_init", node_handle=handle, rmw_handle=0, node_name=name, namespace="/")
        return handle

    def timer(self, node, period):
        timer, callback = self.handle(), self.handle()
        self.add("rcl_timer_init", timer_handle=timer, period=period)
        self.add("rclcpp_timer_callback_added", timer_handle=timer, callback=callback)
        self.add("rclcpp_timer_link_node", timer_handle=timer, node_handle=node)
        return callback

    def run(self, thread, callback, begin, length):
        self.thread, self.now = thread, begin
        self.add("callback_start", callback=callback, is_intra_process=0)
        self.now = begin + length
        self.add("callback_end", callback=callback)
