"""The second reader of looks of sensors in a .ggr file, from the turns that `second_reader` has read."""

from math import inf, isfinite

from second_reader import Array, expect, read_map, split

NEW_MAP, SENSED = 0x03000000, 0x06000001
LOOKS = ("agents", "counts", "which", "forms", "ids")
MOST_IN_DISCS = 1 << 24


def has_looks(recording):
    """Return whether a turn has sensed data."""
    return any(kind == SENSED for turn in recording["turns"] for kind, _ in turn)


def read_looks(recording):
    """Return the looks of each turn: agent, sensor, kind, form, both parts of ids, other data, and covered nodes."""
    first_places = places = _read_places(recording["header"])
    fields, looks = {}, []
    for turn in recording["turns"]:
        looks.append([])
        expect(sum(_count_in_discs(data) for kind, data in turn if kind == SENSED) <= MOST_IN_DISCS, "looks")
        for kind, data in turn:
            if kind == NEW_MAP:
                places = _read_places(data)
            if kind == SENSED:
                looks[-1] += _read_looks(data, fields, places, first_places)
    return looks


def _count_in_discs(data):
    expect(isinstance(data, dict), "looks")
    count = _read_integers(data, "forms").count(6)
    return count * len(_read_integers(data, "seen")) if count else 0


def _read_places(state):
    expect(isinstance(state, dict) and isinstance(state.get("world", b""), bytes), "dict")
    return {id: xy for id, *xy in read_map(state["world"])["nodes"]} if "world" in state else None


def _read_integers(data, name):
    array = data.get(name)
    expect(isinstance(array, Array) and "int" in array.dtype and len(array.shape) == 1, "looks")
    expect(max(array.items, default=0) < 1 << 63, "looks")
    return array.items


def _read_looks(data, fields, places, first_places):
    agents, counts, which, forms, ids = (_read_integers(data, name) for name in LOOKS)
    sizes, sensors, others = map(data.get, ("sizes", "sensors", "others"))
    is_table = isinstance(sizes, Array) and "int" in sizes.dtype and sizes.shape == [len(which), 2]
    expect(is_table and len(forms) == len(which) and len(agents) == len(counts), "looks")
    expect(sum(counts) == len(which) and min(counts, default=0) >= 0, "looks")
    expect(type(sensors) is type(others) is list, "looks")
    expect(all(type(one) is tuple and [*map(type, one)] == [str, str] for one in sensors), "looks")
    owners = [agent for agent, count in zip(agents, counts, strict=True) for _ in range(count)]
    parts = iter(split(ids, sizes.items))
    expect(len(others) == sum(form in (3, 4) for form in forms), "looks")
    rest = iter(others)
    columns = [_read_integers(data, name) for name in ("seen", "seen_at")] if "seen" in data else [[], []]
    expect(len(columns[0]) == len(columns[1]), "looks")
    discs = _read_discs(data, columns, len(sensors), first_places) if 6 in forms else None
    recorded = _read_fields(data, forms, fields)
    found = []
    for agent, sensor, form, field in zip(owners, which, forms, recorded, strict=True):
        first, second, other = next(parts), next(parts), next(rest) if form in (3, 4) else None
        expect(0 <= form <= 6 and 0 <= sensor < len(sensors), "looks")
        expect(form == 1 or len(second) == (len(first) if form in (2, 4) else 0), "looks")
        expect(
            (form not in (3, 6) or not first) and (form != 4 or (type(other) is list and len(other) == len(first))),
            "looks",
        )
        if form == 5:
            expect(all(0 <= place < len(columns[0]) for place in first), "looks")
            first, second = ([column[place] for place in first] for column in columns)
        if form == 6:
            first, second, disc = _look_around(agent, columns, *(part[sensor] for part in discs), first_places)
        nodes = _find_covered(disc if form == 6 else field, places)
        found.append((agent, *sensors[sensor], 2 if form in (5, 6) else form, first, second, other, nodes))
    return found


def _read_discs(data, columns, sensors, places):
    expect(places is not None and "seen" in data, "looks")
    radii, shown = data.get("radii"), data.get("shown")
    expect(isinstance(radii, Array) and radii[:2] == ("float64", [sensors]), "looks")
    expect(isinstance(shown, Array) and shown[:2] == ("bool", [sensors, len(columns[0])]), "looks")
    expect(all(radius >= 0 for radius in radii.items) and len(set(columns[0])) == len(columns[0]), "looks")
    marks = split(shown.items, [len(columns[0])] * sensors)
    expect(all(node in places or not any(row[at] for row in marks) for at, node in enumerate(columns[1])), "looks")
    return radii.items, marks


def _look_around(agent, columns, radius, is_shown, places):
    expect(agent in columns[0], "looks")
    middle = columns[1][columns[0].index(agent)]
    expect(middle in places, "looks")
    x, y = places[middle]
    found = []
    for number, node, is_known in zip(*columns, is_shown, strict=True):
        if is_known and number != agent:
            dx, dy = places[node][0] - x, places[node][1] - y
            found += [(number, node)] if dx * dx + dy * dy <= radius * radius else []
    return [number for number, _ in found], [node for _, node in found], (middle, radius, b"") if radius < inf else None


def _read_fields(data, forms, fields):
    if "fields" not in data:
        return [None] * len(forms)
    numbers, first, new = map(data.get, ("fields", "first_field", "new_fields"))
    expect(isinstance(numbers, Array) and "uint" in numbers.dtype and numbers.shape == [len(forms)], "fields")
    expect(not any(number for number, form in zip(numbers.items, forms, strict=True) if form == 6), "fields")
    expect(type(first) is int and first >= 0 and type(new) is list, "fields")
    for field in new:
        expect(type(field) is tuple and [*map(type, field[1:])] == [float, bytes] and 0 <= field[1] < inf, "fields")
        is_position = type(field[0]) is tuple and [*map(type, field[0])] == [float, float]
        expect(type(field[0]) is int or (is_position and all(map(isfinite, field[0]))), "fields")
    expect(max(numbers.items, default=0) <= first + len(new), "fields")
    if first == 0:
        fields.clear()
    fields |= enumerate(new, first)
    return [fields.get(number - 1) for number in numbers.items]


def _find_covered(field, places):
    if field is None or places is None:
        return None
    place, radius, bits = field
    expect(type(place) is tuple or place in places, "fields")
    x, y = place if type(place) is tuple else places[place]
    is_near = {id: (a - x) * (a - x) + (b - y) * (b - y) <= radius * radius for id, (a, b) in places.items()}
    near = sorted(id for id in places if is_near[id])
    expect(len(bits) in (0, -(-len(near) // 8)), "fields")
    return [id for at, id in enumerate(near) if not (bits and bits[at // 8] << at % 8 & 128)]
