"""Reads recordings (`.ggr`) without GAMMS, as docs/recording-format.md describes them, and compares with GAMMS."""

import io
import struct
import zlib
from itertools import accumulate

from msgspec.msgpack import Ext, decode

COLUMNS_OF = {0x01100020: (1, 3), 0x01100021: (0, 4)}  # events in columns: how many nodes and floats they have


def blocks_of(data):
    """Yield the blocks of a finished recording: type, turns before it, turns, moves, events, body."""
    at = 8
    while data[at : at + 3] == b"\xd3GB":
        head = data[at : at + 36]
        letter, size, crc, _, first, turns, moves, events, head_crc = struct.unpack_from("<B8I", head, 3)
        body = data[at + 36 : at + 36 + size]
        if zlib.crc32(head[:32]) != head_crc or zlib.crc32(body) != crc:
            raise ValueError(f"damaged at byte {at}")
        yield chr(letter), first, turns, moves, events, body
        at += 36 + size


def unpacked(body):
    """Return packed bytes, and the bytes that follow them."""
    size = shift = at = 0
    while True:
        size |= (body[at] & 127) << shift
        shift += 7
        at += 1
        if body[at - 1] < 128:
            break
    inflate = zlib.decompressobj(-15)
    data = inflate.decompress(body[at:])
    if len(data) != size:
        raise ValueError("the size is wrong")
    return data, inflate.unused_data


def value_of(data):
    """Return a value; arrays stay as they are written."""
    return opened(decode(data)[0])


def opened(item):
    """Return an item of MessagePack as a plain value."""
    if not isinstance(item, Ext):
        return item
    if item.code == 5:
        return item.data
    if item.code == 6:
        return int.from_bytes(item.data, "big", signed=True)
    if item.code == 7:
        return item.data.decode("utf-8", "surrogatepass")
    items = [opened(one) for one in decode(item.data)]
    if item.code == 2:
        return dict(zip(items[::2], items[1::2], strict=True))
    return {0: tuple, 1: list, 3: set, 4: frozenset, 8: tuple}[item.code](items)


def columns_of(data):
    """Return a function that reads the next column with a given number of integers."""
    at = 0

    def column(size):
        nonlocal at
        if data[at] == 9:
            return column_with_table(size)
        begin, count = at + 1, data[at]
        at = begin + count * size
        planes = [data[begin + i * size : begin + (i + 1) * size] for i in range(count)]
        numbers = [int.from_bytes(number, "little") for number in zip(*planes, strict=True)]
        return [n // 2 if n % 2 == 0 else -(n // 2) - 1 for n in numbers]

    def column_with_table(size):  # as versions before 2.0 wrote some
        nonlocal at
        entries = data[at + 1] + 1
        at += 2
        table = list(accumulate(column(entries)))
        each = data[at]
        groups = data[at + 1 : at + 1 + -(-size // each)]
        at += 1 + len(groups)
        return [table[groups[i // each] // entries ** (i % each) % entries] for i in range(size)]

    return column


def tracks_of(column, rows, order=1):
    """Return a number for each of these rows, from the columns of the first and of the other numbers of each row."""
    firsts = dict(zip(sorted(set(rows)), accumulate(column(len(set(rows)))), strict=True))
    others, found = iter(column(len(rows) - len(firsts))), {}
    for row, first in firsts.items():
        steps = [next(others) for _ in range(rows.count(row) - 1)]
        found[row] = accumulate(accumulate(steps) if order == 2 else steps, initial=first)
    return [next(found[row]) for row in rows]


def float_of(bits):
    """Return the float with these bits."""
    return struct.unpack("<d", (bits % 2**64).to_bytes(8, "little"))[0]


def numbers_of(column, size, nodes, floats):
    """Return the data of flights, or of turns in space."""
    rows = list(accumulate(column(size)))
    parts = [rows] + [tracks_of(column, rows) for _ in range(nodes)]
    parts += [[float_of(bits) for bits in tracks_of(column, rows, order=2)] for _ in range(floats)]
    return zip(*parts, strict=True)


def turns_of(body, turns, moves, events):
    """Yield the turns of a block, each a list of moves (row, node) and events (kind, data)."""
    values, rest = unpacked(body)
    column = columns_of(unpacked(rest)[0])
    moves_of_turn, events_of_turn = column(turns), column(turns)
    rows = list(accumulate(column(moves)))
    moves = list(zip(rows, tracks_of(column, rows), strict=True))
    after, kinds, sizes = list(accumulate(column(events))), column(events), column(events)
    ends = list(accumulate(sizes, initial=0))
    in_columns = {
        kind: numbers_of(column, kinds.count(kind), *shape) for kind, shape in COLUMNS_OF.items() if kind in kinds
    }
    events = [
        (kind, next(in_columns[kind]) if kind in in_columns else value_of(values[ends[i] : ends[i + 1]]))
        for i, kind in enumerate(kinds)
    ]
    move = event = 0
    for n_moves, n_events in zip(moves_of_turn, events_of_turn, strict=True):
        turn = moves[move : move + n_moves]
        for i in reversed(range(event, event + n_events)):
            turn.insert(after[i] - move, events[i])
        yield turn
        move += n_moves
        event += n_events


def main():
    """Write two small recordings with GAMMS, and print what the functions above read."""
    from gamms.recorder import Writer

    stream = io.BytesIO()
    writer = Writer(stream, {"seed": 7})
    writer.add_turn([0, 5, 1, 9])  # rows 0 and 1 move to nodes 5 and 9
    writer.add_turn([0, 6, (4, {"hit": True})])
    writer.close()
    for letter, first, turns, moves, events, body in blocks_of(stream.getvalue()):
        print(letter, first, turns, moves, events)
        if letter == "H":
            print(value_of(unpacked(body)[0]))
        if letter == "T":
            print(*turns_of(body, turns, moves, events), sep="\n")
            values, rest = unpacked(body)
            print(values.hex(" "), unpacked(rest)[0].hex(" "), sep="\n")

    print("flights come back to the last bit:")
    stream = io.BytesIO()
    writer = Writer(stream, {})
    for x in (0.1, 0.2, 0.3):
        writer.add_turn([(0x01100020, (0, 5, x, 0.0, 8.0)), (0x01100020, (1, 6, -x, x, 8.0))])
    writer.add_turn([(0x01100021, (0, 1.0, 0.0, 0.0, 0.0))])
    writer.close()
    for letter, _, *counts, body in blocks_of(stream.getvalue()):
        if letter == "T":
            print(*turns_of(body, *counts), sep="\n")

    print("a column with a table:", columns_of(bytes.fromhex("09 01 02 9f 70 0f 17 01 01 01 00 01"))(4))


if __name__ == "__main__":
    main()
