"""The viewer in a browser, from a file and without a network: it plays, seeks, and obeys mouse, fingers and keys."""

import html
import io
import json

import browser
import numpy as np
import pytest

import gamms
from gamms import recorder, web
from gamms.visual.backends.pillow_backend import decode_pixels


@pytest.fixture(scope="module")
def walk(game, tmp_path_factory):
    """The page of a game."""
    path = tmp_path_factory.mktemp("walk") / "game.html"
    with recorder.open(game) as recording:
        recording.save(path, title="A walk")
    return path


@pytest.fixture
def page(chromium, walk):
    """That page, opened: other tests leave their own behind, and the order in which processes take tests differs."""
    return chromium.open(walk)


def test_it_shows_the_game_and_the_console_stays_empty(page):
    page.settle()
    assert page.value("document.title") == "A walk"
    assert page.value("gamms.turns") == 80
    assert page.value("document.querySelector('h1').textContent") == "A walk"
    places = page.value("gamms.views[0].scene.discs.map((disc) => [disc.name, disc.x, disc.y])")
    assert places == [["red_0", 0, 0], ["red_1", 30, 0], ["blue_2", 50, 50], ["blue_3", 0, 50]]
    assert page.messages == []


def test_a_link_names_the_moment_that_is_shown(page):
    page.value("gamms.seek(12)")
    page.value("gamms.select('blue_2')")
    page.wait("location.hash === '#turn=12&agent=blue_2'")
    page.value("location.hash = '#turn=30&agent=red_1'")
    page.wait("gamms.turn === 30 && gamms.look.selected === 'red_1'")
    page.value("location.hash = '#turn=9999&agent=nobody&fog=nobody'")
    page.wait("gamms.turn === 80 && gamms.look.selected === null && gamms.look.fog === null")
    page.value("location.hash = '#turn=3&play'")
    page.wait("gamms.turn > 3 && gamms.isPlaying")


def test_the_map_stands_beside_the_panel_of_an_agent(page):
    page.value("gamms.select('blue_2')")
    page.click(*centre(page, "[aria-label='What is shown']"))
    page.settle()
    box = "document.querySelector({}).getBoundingClientRect()"
    assert page.value(f"{box.format(repr('#look'))}.right") <= page.value(f"{box.format(repr('.panel'))}.left")


def test_keys_step_play_and_zoom(page, game):
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft", "End"):
        page.key(key)
    assert page.value("gamms.turn") == 80
    page.key("Home")
    page.key(" ")
    page.wait("gamms.position > 0.2")
    page.key(" ")
    assert page.value("gamms.isPlaying") is False
    scale = page.value("gamms.views[0].scene.camera.scale")
    page.key("+")
    assert page.value("gamms.views[0].scene.camera.scale") > scale
    page.key("0")
    assert page.value("gamms.views[0].scene.camera.scale") == pytest.approx(scale)
    for keys, turn in ((("Home", ".", ".", ","), 1), (("End", ","), 79), (("Home",), 0)):
        for key in keys:
            page.key(key)
        assert page.value("gamms.turn") == turn
    for key, is_hidden in (("?", False), ("F1", True)):
        page.key(key)
        assert page.value("document.querySelector('#keys').hidden") is is_hidden


SPACE = {"code": "Space", "windowsVirtualKeyCode": 32}


def centre(page, selector):
    """Return where the middle of an element is on the page."""
    box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
    return page.value(f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({box})")


def test_the_space_bar_plays_after_the_line_of_turns_was_dragged_or_clicked(page):
    x, y = centre(page, ".track")
    for use in (lambda: page.drag((x - 300, y), (x, y)), lambda: page.click(x, y)):
        use()
        assert page.value("gamms.isPlaying") is False
        page.key(" ", **SPACE)
        page.wait("gamms.isPlaying && gamms.position > gamms.first + 40.5")
        page.key(" ", **SPACE)
        assert page.value("gamms.isPlaying") is False


def test_the_space_bar_plays_after_buttons_and_boxes_were_clicked(page):
    page.click(*centre(page, "[aria-label='What is shown']"))
    for control in ("[aria-label^='One turn on']", "#look input[type=checkbox]", "[aria-label='Zoom in (+)']"):
        page.click(*centre(page, control))
        before = page.value("[gamms.turn, gamms.look.labels, gamms.views[0].scene.camera.scale]")
        page.key(" ", **SPACE)
        assert page.value("gamms.isPlaying") is True, control
        page.key(" ", **SPACE)
        page.value(f"gamms.seek({before[0]})")
        assert page.value("[gamms.turn, gamms.look.labels, gamms.views[0].scene.camera.scale]") == before, control


def test_controls_that_the_keyboard_reached_take_their_own_keys(page):
    page.value("gamms.panel.open(), document.querySelector('details summary').focus()")
    page.key(" ", **SPACE)
    assert page.value("[gamms.isPlaying, document.querySelector('details').open]") == [False, False]
    page.value("document.querySelector('.speed').focus()")
    dark = page.value("gamms.look.theme")
    page.key("n", code="KeyN", windowsVirtualKeyCode=78)
    assert page.value("gamms.look.theme") == dark, "a menu looks for the letters that are typed"
    page.value("document.querySelector('.track input').focus()")
    page.key(" ", **SPACE)
    assert page.value("gamms.isPlaying") is True


def test_the_wheel_scrolls_the_page_around_a_frame_unless_ctrl_is_held(chromium, game, tmp_path):
    with recorder.open(game) as recording:
        viewer = html.escape(web.page(recording).decode())
    frame = f'<iframe width="800" height="500" srcdoc="{viewer}"></iframe>'
    (tmp_path / "around.html").write_text(f"<!DOCTYPE html><title>text</title>{frame}<p style='height: 3000px'>")
    page = chromium.open(tmp_path / "around.html", until="frames[0]?.gamms?.turns === 80")
    page.settle()
    scale = "frames[0].gamms.views[0].scene.camera.scale"
    before = page.value(scale)
    page.mouse("mouseWheel", 400, 200, deltaX=0, deltaY=120)
    page.wait("scrollY > 100")
    assert page.value(scale) == before
    page.value("scrollTo(0, 0)")
    page.settle()
    page.mouse("mouseWheel", 400, 200, deltaX=0, deltaY=-120, modifiers=2)
    page.wait(f"{scale} > {before}")
    assert page.value(scale) < 1.5 * before, "a notch of the wheel zooms as far as on a page of its own"
    assert page.value("scrollY") == 0
    assert "ctrl + wheel" in page.value("frames[0].document.getElementById('keys').textContent")


@pytest.mark.parametrize(("rows", "columns", "is_stamp"), [(40, 4, True), (8, 10, False)])
def test_in_a_frame_a_slim_map_begins_with_the_agent_that_most_happens_to(chromium, tmp_path, rows, columns, is_stamp):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(rows, columns))
        for node, name in enumerate(("anna", "ben", "carl")):
            ctx.agent.create_agent(name, start_node_id=node, strategy=gamms.strategies.stay)

        @ctx.game.add
        def happen(ctx):
            ctx.game.emit("sings", agent="ben" if ctx.game.turn < 9 else "carl")

        ctx.game.run(max_turns=10, record=tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as recording:
        viewer = html.escape(web.page(recording).decode())
    frame = f'<iframe width="800" height="500" srcdoc="{viewer}"></iframe>'
    (tmp_path / "around.html").write_text(f"<!DOCTYPE html><title>text</title>{frame}")
    page = chromium.open(tmp_path / "around.html", until="frames[0]?.document.getElementById('viewer')?.dataset.isRead")
    page.settle()
    followed = page.value("frames[0].gamms.isFollowing ? frames[0].gamms.look.selected : null")
    assert followed == ("ben" if is_stamp else None)
    camera = "frames[0].gamms.views[0].scene.camera"
    assert page.value(f"{camera}.isFitted") is not is_stamp
    page.value("frames[0].gamms.settings.fit()")
    page.settle()
    assert page.value(f"[{camera}.isFitted, frames[0].gamms.isFollowing]") == [True, False]
    with recorder.open(tmp_path / "game.ggr") as recording:
        recording.save(tmp_path / "game.html")
    for size, is_followed in (((844, 390), is_stamp), ((1280, 720), False)):  # a phone, and a screen
        page.open(tmp_path / "game.html", *size)
        assert page.value("gamms.isFollowing") is is_followed


@pytest.mark.parametrize("shape", [(4, 12), (12, 4), (1, 20)])
@pytest.mark.parametrize("size", [(390, 844), (844, 390)])
def test_a_slim_map_that_is_seen_whole_stays_whole_on_phones(chromium, tmp_path, shape, size):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(*shape))
        ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.stay)
        ctx.game.run(max_turns=2, record=tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as recording:
        recording.save(tmp_path / "game.html")
    page = chromium.open(tmp_path / "game.html", *size)
    assert page.value("[gamms.isFollowing, gamms.views[0].scene.camera.isFitted]") == [False, True]


@pytest.mark.parametrize("size", [(1280, 720), (800, 600), (390, 844), (345, 416)])
@pytest.mark.parametrize("has_panel", [False, True])
def test_the_source_of_the_map_can_be_read(chromium, tmp_path, size, has_panel):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.graph.graph.attribution = "© OpenStreetMap contributors, ODbL 1.0"
        ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.stay)
        ctx.game.run(max_turns=2, record=tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as recording:
        recording.save(tmp_path / "game.html")
    page = chromium.open(tmp_path / "game.html", *size)
    if has_panel:
        page.value("gamms.panel.open()")
    page.settle()
    boxes = page.value(
        "[...document.querySelectorAll('.credit, .bar, .panel:not([hidden]), .head, .toolbar')].map((one) => "
        "(({left, top, right, bottom}) => [one.className, left, top, right, bottom])(one.getBoundingClientRect()))"
    )
    [(_, *credit)] = [one for one in boxes if one[0] == "credit"]
    assert credit[0] >= 0
    assert credit[2] <= size[0]
    for name, left, top, right, bottom in boxes:
        is_apart = credit[2] <= left or credit[0] >= right or credit[3] <= top or credit[1] >= bottom
        assert is_apart or name == "credit", name


@pytest.mark.parametrize("size", [(1280, 720), (800, 600), (390, 844)])
def test_the_panel_stands_beside_the_map_and_the_selection_stays_in_view(chromium, walk, size):
    page = chromium.open(walk, *size)
    discs = (
        "gamms.views.flatMap(({scene, canvas}) => scene.discs.map(({name, px, py}) => "
        "[name, px + canvas.getBoundingClientRect().left, py + canvas.getBoundingClientRect().top]))"
    )
    panel = "document.querySelector('.panel').getBoundingClientRect()"
    box = f"(({{left, top, right, bottom}}) => [left, top, right, bottom])({panel})"
    page.settle()
    whole = page.value(discs)
    page.value("gamms.panel.open()")
    page.settle()
    left, top, right, bottom = page.value(box)
    for name, x, y in page.value(discs):
        assert not (left - 6 < x < right + 6 and top - 6 < y < bottom + 6), name
    page.value("gamms.panel.close()")
    page.settle()
    assert page.value(discs) == whole
    page.value("gamms.moveCamera((camera) => camera.zoom(3, 0, 0))")
    page.settle()
    name, x, y = max(page.value(discs), key=lambda disc: -abs(disc[1] - size[0] / 2) - abs(disc[2] - size[1] / 2))
    page.click(x, y)
    page.settle()
    [(x, y)] = [(x, y) for other, x, y in page.value(discs) if other == name]
    left, top, right, bottom = page.value(box)
    assert (0 < x < size[0], 0 < y < size[1]) == (True, True)
    assert not (left < x < right and top < y < bottom)


@pytest.mark.parametrize("size", [(1280, 720), (700, 600), (390, 844)])
def test_the_map_is_clear_of_cards_and_captions(chromium, walk, size):
    page = chromium.open(walk, *size)
    overlaps = """(({camera}) => {
      const [left, top] = camera.toScreen(camera.box.left, camera.box.top);
      const [right, bottom] = camera.toScreen(camera.box.right, camera.box.bottom);
      return camera.covered.map((one) => one.right > left && one.left < right && one.bottom > top && one.top < bottom);
    })(gamms.views[0].scene)"""
    assert page.value(overlaps) == [False] * (3 if size[0] > 1000 else 2)


def test_dragging_the_timeline_shows_any_turn(page, game):
    box = page.value(
        "(({x, y, width, height}) => [x, y, width, height])(document.querySelector('.track').getBoundingClientRect())"
    )
    page.drag((box[0] + 1, box[1] + box[3] / 2), (box[0] + box[2] / 2, box[1] + box[3] / 2))
    turn = page.value("gamms.turn")
    assert abs(turn - 40) <= 1
    with recorder.open(game) as recording:
        nodes = recording[turn].agents["node"].tolist()
    assert page.value(browser.NODES) == nodes


def test_the_mouse_moves_the_map_and_the_wheel_zooms_around_it(page):
    page.value("gamms.settings.fit()")
    page.settle()
    camera = "(({x, y, scale}) => [x, y, scale])(gamms.views[0].scene.camera)"
    x, y, scale = page.value(camera)
    page.drag((600, 300), (700, 350))
    moved = page.value(camera)
    assert moved[0] == pytest.approx(x - 100 / scale, abs=1.0)
    assert moved[1] == pytest.approx(y + 50 / scale, abs=1.0)
    under = "gamms.views[0].scene.camera.toWorld(500, 300)"
    before = page.value(under)
    page.mouse("mouseWheel", 500, 300, deltaX=0, deltaY=-200)
    page.wait(f"gamms.views[0].scene.camera.scale > {moved[2]}")
    assert page.value(under) == pytest.approx(before)


def test_a_click_on_an_agent_shows_its_knowledge(page):
    page.value("gamms.settings.fit(), gamms.seek(12)")
    page.settle()
    x, y = page.value("(({px, py}) => [px, py])(gamms.views[0].scene.discOf('red_0'))")
    page.click(x, y)
    words = page.value("document.querySelector('.panel').textContent")
    for part in ("red_0", "Decision in turn 12", "What its sensors tell it", "eyes (AGENT_RANGE)"):
        assert part in words
    page.key("Escape")
    assert page.value("gamms.look.selected") is None


def test_older_sensor_data_is_not_shown_as_seen_now(page):
    page.value("gamms.select('red_0')")
    headings = "[...document.querySelectorAll('.panel h3')].map((one) => one.textContent)"
    for turn, heading in ((79, "What its sensors tell it"), (80, "What its sensors told it in turn 80")):
        page.value(f"gamms.seek({turn}), gamms.panel.renew(true)")
        assert heading in page.value(headings)


@pytest.mark.parametrize("options", [{}, {"sensors": True}, {"sensors": False}])
def test_views_of_sensors_are_shown_as_in_pictures_unless_they_are_left_out(chromium, game, tmp_path, options):
    with recorder.open(game) as recording:
        recording.save(tmp_path / "game.html", **options)
    chromium.open(tmp_path / "game.html")
    assert chromium.value("gamms.look.sensors") is options.get("sensors", True)


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """A page of a drone that flies in its first turn, a walker by metres, and one that speaks to nobody in reach."""

    def fly(state):
        state["action"] = (3.0, 4.0, 0.0) if state["turn"] == 0 else (0.0, 0.0, 0.0)
        state["outbox"].append({"channel": "radio", "to": "walker", "body": "hello"})

    def walk(state):
        state["action"] = min(3, max(state["legal"]))

    path = tmp_path_factory.mktemp("moved") / "moved.html"
    stream = io.BytesIO()
    with gamms.create_context(seed=1, game={"speed_unit": "metres"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 8))
        eyes = {"a_long_name": gamms.sensor.occluded_aerial_agent(range_m=5.0)}
        given = {"type": "AERIAL", "position": (20.0, 10.0, 8.0), "speed": 5.0, "sensors": eyes, "strategy": fly}
        ctx.agent.create_agent("drone", start_node_id=0, **given)
        ctx.agent.create_agent("walker", start_node_id=0, speed=14.0, strategy=walk)
        ctx.game.add_channel("radio", range_m=1.0)
        ctx.game.run(max_turns=3, record=stream, sensed=True)
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        recording.save(path)
    return path


@pytest.mark.parametrize(
    ("agent", "turn", "move"),
    [
        ("drone", 1, "flies to (23.0, 14.0, 8.0)"),
        ("drone", 2, "stays"),
        ("walker", 1, "goes to 1, goes on toward 2"),
        ("walker", 3, "goes to 3"),
    ],
)
def test_the_panel_says_by_which_move_an_agent_got_where_it_is(chromium, moved, agent, turn, move):
    page = chromium.open(moved)
    page.value(f"gamms.seek({turn}), gamms.select('{agent}')")
    said = (
        "[...document.querySelectorAll('.panel dt')].find((one) => one.textContent === 'move').nextSibling.textContent"
    )
    assert page.value(said) == move


def test_sensor_data_is_on_one_line_beside_a_long_name(chromium, moved):
    page = chromium.open(moved)
    page.value("gamms.select('drone')")
    said = "[...document.querySelectorAll('.panel dd')].find((one) => one.textContent === 'nothing')"
    page.value(f"window.range = document.createRange(), range.selectNodeContents({said})")
    assert page.value("range.getClientRects().length") == 1
    assert page.value(f"{said}.previousSibling.textContent") == "a_long_name (OCCLUDED_AERIAL_AGENT)"


def test_an_unheard_message_is_a_ring_that_fades_and_can_be_left_out(chromium, moved):
    page = chromium.open(moved)
    assert "Messages" in page.value(
        "[...document.querySelectorAll('#look label > span')].map((one) => one.textContent)"
    )
    page.value("gamms.seek(2)")
    page.settle()
    page.value(
        """(() => {
          const { scene } = gamms.views[0], { arc } = scene.to, found = [];
          scene.to.arc = function (x, y, radius, ...rest) {
            found.push([Math.round(radius), this.strokeStyle]);
            arc.call(this, x, y, radius, ...rest);
          };
          window.arcs = (share, messages) => {
            found.length = 0;
            scene.paint({ ...gamms.look, messages }, share, false);
            return [...found];
          };
        })()"""
    )
    rings = []
    for share in (0.1, 1):
        without, found = (page.value(f"arcs({share}, {messages})") for messages in ("false", "true"))
        assert len(found) == len(without) + 1
        rings.append(found[0])  # which is painted first, below agents
    (first, strong), (last, faint) = rings
    assert first < last
    alphas = [float(color.split(",")[-1].strip(" )")) for color in (strong, faint)]
    assert alphas[0] > alphas[1] > 0.2


def test_two_fingers_zoom_on_a_phone(chromium, walk):
    chromium.open(walk, 390, 800, touch=True, scale=2)
    chromium.settle()
    scale = chromium.value("gamms.views[0].scene.camera.scale")
    chromium.touch("touchStart", (150, 300), (250, 300))
    chromium.touch("touchMove", (100, 300), (300, 300))
    chromium.touch("touchEnd")
    chromium.wait(f"gamms.views[0].scene.camera.scale > {1.5 * scale}")
    width = chromium.value("document.documentElement.scrollWidth")
    assert width == 390
    box = chromium.value(
        "(({right, bottom}) => [right, bottom])(document.querySelector('.bar').getBoundingClientRect())"
    )
    assert box[0] <= 390
    assert box[1] <= 800


def test_a_notebook_shows_the_viewer_in_a_frame_that_reaches_nothing_of_it(chromium, game, tmp_path):
    with recorder.open(game) as recording:
        (tmp_path / "notebook.html").write_text(f"<!DOCTYPE html><title>cells</title>{recording._repr_html_()}")
    chromium.open(tmp_path / "notebook.html", until="document.title == 'cells' && document.readyState == 'complete'")
    for _ in range(20):
        chromium.settle()
        if decode_pixels(chromium.picture())[200:500].std() > 10.0:  # the map
            break
    else:
        pytest.fail(f"the frame stays blank: {chromium.messages}")
    assert chromium.messages == []
    assert chromium.value("document.querySelector('iframe').contentDocument") is None


def test_an_unfinished_recording_is_said_to_be_so(chromium, game, tmp_path):
    (tmp_path / "cut.ggr").write_bytes(game.read_bytes()[:-40])
    with recorder.open(tmp_path / "cut.ggr") as cut, recorder.open(game) as whole:
        cut.save(tmp_path / "cut.html")
        (tmp_path / "two.html").write_bytes(web.page_of_two(whole, cut, names=("whole", "cut")))
        warning = cut.warning
    shown = "[...document.querySelectorAll('.head .warning')].map((one) => one.textContent)"
    for name, said in (("cut", [warning]), ("two", [f"cut: {warning}"])):
        assert chromium.open(tmp_path / f"{name}.html").value(shown) == said


def test_a_damaged_recording_is_said_to_be_so(chromium, game, tmp_path):
    with recorder.open(game) as recording:
        text = web.page(recording).decode()
    start = text.index('class="recording">') + 400
    (tmp_path / "damaged.html").write_text(text[:start] + "AAAA" + text[start + 4 :])
    chromium.open(tmp_path / "damaged.html")
    assert "damaged" in chromium.value("document.querySelector('.failure').textContent")


def test_names_of_a_knot_share_a_label_which_covers_no_flag(chromium, tmp_path):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        for name, node in (("anna", 12), ("bert", 12), ("carl", 12), ("dora", 3)):
            ctx.agent.create_agent(name, start_node_id=node, team="red", strategy=lambda state: None)
        ctx.agent.create_agent("enemy", start_node_id=24, team="blue", strategy=lambda state: None)
        ctx.game.add(gamms.rules.capture_flag({"red": 3, "blue": 13}))
        ctx.record.start(tmp_path / "knot.ggr")
        ctx.game.run(max_turns=1)
    with recorder.open(tmp_path / "knot.ggr") as recording:
        recording.save(tmp_path / "knot.html", labels=True)
    chromium.open(tmp_path / "knot.html")
    chromium.settle()
    labels = chromium.value("gamms.views[0].scene.labels.map(({lines, box}) => [lines, box])")
    assert sorted(lines for lines, _ in labels) == [["anna", "bert", "carl"], ["dora"], ["enemy"]]
    flags = chromium.value("[[3, 0], [3, 2]].map(([x, y]) => gamms.views[0].scene.camera.toScreen(10 * x, 10 * y))")
    for _, (left, top, right, bottom) in labels:
        for x, y in flags:
            assert not (left < x + 8 and right > x and top < y and bottom > y - 12)


def test_hostile_names_execute_nothing(chromium, tmp_path):
    name = "</script><img src=x onerror='window.attacked=true'>"
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.add_nodes([0, 1], x=[0, 10], y=[0, 0])
        ctx.graph.add_edges([0, 1], sources=[0, 1], targets=[1, 0])
        ctx.agent.create_agent(name, start_node_id=0, team=name, strategy=lambda state: state.update(action=1))
        ctx.record.start(tmp_path / "hostile.ggr")
        ctx.game.emit(name, agent=name)
        ctx.game.scores[name] = 3
        ctx.game.run(max_turns=2)
    with recorder.open(tmp_path / "hostile.ggr") as recording:
        recording.save(tmp_path / "hostile.html", title=name)
    chromium.open(tmp_path / "hostile.html")
    chromium.value("gamms.seek(2), gamms.panel.open(), gamms.select([...gamms.views[0].replay.state.agents.keys()][0])")
    chromium.settle()
    assert chromium.value("window.attacked") is None
    assert chromium.value("document.images.length") == 0
    assert chromium.value("document.querySelector('.panel h2').textContent") == name


@pytest.fixture(scope="module")
def walled(tmp_path_factory):
    """A game between walls: what rules keep, sensors of agents, and the nodes that they cover."""
    path = tmp_path_factory.mktemp("walled") / "walled.ggr"
    kinds, covered = gamms.sensor.SensorType, {}
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(9, 9))
        ctx.graph.add_obstacles([[(25, y, 9), (25, y + 30, 9), (25, y, 0), (25, y + 30, 0)] for y in (12, 52)])
        fields = {"past": ("OCCLUDED_AGENT", "OCCLUDED_MAP", {"sensor_range": 45.0})}
        fields["ahead"] = ("AGENT_ARC", "ARC", {"sensor_range": 35.0, "fov": 1.3, "orientation": (0.6, 0.8)})
        for number, (name, (of_agents, _, keywords)) in enumerate(fields.items()):
            eye = ctx.sensor.create_sensor(name, kinds[of_agents], **keywords)
            given = {"sensors": {"eye": eye.sensor_id}, "strategy": east}
            ctx.agent.create_agent(name, start_node_id=30 + 10 * number, team=f"team {name}", **given)
        ctx.game.add(gamms.rules.hold([31, 32], 5, ends=False))
        ctx.game.add(gamms.rules.discover([33, 80]))
        ctx.game.add(gamms.rules.resource("fuel", 10, per_edge=4))
        ctx.record.start(path, sensed=True)
        ctx.game.run(2)
        for name, (_, of_nodes, keywords) in fields.items():
            agent = ctx.agent.get_agent(name)
            sensor = ctx.sensor.create_sensor(f"map of {name}", kinds[of_nodes], **keywords)
            agent.register_sensor("map", sensor)
            sensor.sense(agent.current_node_id)
            covered[name] = sorted(sensor.data["nodes"])
            agent.deregister_sensor("map")
        ctx.game.step()  # in which the eyes look
        ctx.record.stop()
    return path, covered


def east(state):
    """Go to the right."""
    state["action"] = state["curr_pos"] + 1


def test_fog_past_walls_and_ahead_is_that_of_sensors_of_nodes(chromium, walled, tmp_path):
    path, covered = walled
    with recorder.open(path) as recording:
        recording.save(tmp_path / "walled.html", turn=2)
    page = chromium.open(tmp_path / "walled.html")
    for name, nodes in covered.items():
        page.value(f"gamms.change({{fog: 'team {name}'}}), gamms.select('{name}')")
        page.settle()
        scene = "gamms.views[0].scene"
        found = page.value(f"[...{scene}.sightOfTeam.nodes].map((row) => {scene}.world.nodeIds[row])")
        assert sorted(found) == nodes
        assert 1 < len(nodes) < 81
    assert page.value("[...document.querySelectorAll('.list .row')].map((row) => row.textContent)") == []
    page.value("gamms.select(null)")
    assert page.value("document.querySelectorAll('.list .row').length") == 1
    assert page.messages == []


DOWN, OBLIQUE, AHEAD = (0.5**0.5, 0.0, 0.5**0.5, 0.0), (0.9, 0.1, 0.35, 0.2), (1.0, 0.0, 0.0, 0.0)
DRONES = {  # kind of sensor, its direction, range and angle, and where its drone is
    "below": ("AERIAL_AGENT", DOWN, 30.0, 1.5, (42.0, 38.0, 15.0)),
    "aside": ("AERIAL_AGENT", OBLIQUE, 50.0, 0.9, (18.0, 22.0, 12.0)),
    "round": ("AERIAL_AGENT", AHEAD, 31.0, 7.0, (55.0, 55.0, 9.0)),
    "ahead": ("AERIAL_AGENT", AHEAD, 60.0, 2.0, (11.0, 71.0, 8.0)),
    "low": ("OCCLUDED_AERIAL_AGENT", AHEAD, 45.0, 7.0, (41.0, 27.0, 5.0)),
    "high": ("OCCLUDED_AERIAL_AGENT", OBLIQUE, 70.0, 2.2, (8.0, 30.0, 21.0)),
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A game of drones that turn, over walls and a hill, and the nodes on which their sensors report agents."""
    path, covered = tmp_path_factory.mktemp("flown") / "flown.ggr", {}
    with gamms.create_context(seed=1) as ctx:
        graph = gamms.graph.grid(9, 9)
        for node in (60, 61, 70):
            graph.nodes[node]["z"] = 6.5
        ctx.graph.attach_networkx_graph(graph)
        ctx.graph.add_obstacles([[(25, y, 9), (25, y + 30, 9), (25, y, 0), (25, y + 30, 0)] for y in (12, 52)])
        for name, (kind, quat, far, fov, place) in DRONES.items():
            eye = ctx.sensor.create_sensor(name, kind, sensor_range=far, fov=fov, quat=quat)
            given = {"type": "AERIAL", "position": place, "speed": 3.0, "quat": (0.9, 0.0, 0.1, 0.3)}
            ctx.agent.create_agent(name, start_node_id=0, team=name, sensors={"eye": eye}, strategy=rise, **given)
        ctx.record.start(path, sensed=True)
        ctx.game.run(1)
        for name in DRONES:
            agent = ctx.agent.get_agent(name)
            covered[name] = {*agent.sensors["eye"].coverage(None).node_ids.tolist(), agent.current_node_id}
        ctx.game.step()  # in which the eyes look
        ctx.record.stop()
    return path, covered


def rise(state):
    """Fly upwards."""
    state["action"] = (0.3, 0.1, 1.0)


def test_fog_below_flyers_is_where_their_sensors_report_agents(chromium, flown, tmp_path):
    path, covered = flown
    with recorder.open(path) as recording:
        recording.save(tmp_path / "flown.html", turn=1)
    page = chromium.open(tmp_path / "flown.html")
    for name, nodes in covered.items():
        page.value(f"gamms.change({{fog: '{name}', sensors: true}})")
        page.settle()
        scene = "gamms.views[0].scene"
        found = page.value(f"[...{scene}.sightOfTeam.nodes].map((row) => {scene}.world.nodeIds[row])")
        assert set(found) == nodes, name
        assert 3 < len(nodes) < 70
    assert page.messages == []


def test_fields_of_view_of_flyers_are_painted_dashed_where_obstacles_can_hide_something(chromium, flown, tmp_path):
    with recorder.open(flown[0]) as recording:
        recording.save(tmp_path / "flown.html", turn=1)
    page = chromium.open(tmp_path / "flown.html")
    shapes = dict(
        page.value(
            "[...gamms.views[0].replay.sensed].map(([name, [look]]) => [name, look.shape && look.shape.isBlocked])"
        )
    )
    assert shapes == {name: kind.startswith("OCCLUDED") for name, (kind, *_) in DRONES.items()}
    dashes = page.value(
        """(() => {
          const { scene } = gamms.views[0], found = new Set(), { setLineDash } = scene.to;
          scene.to.setLineDash = function (dash) { found.add(dash.length); setLineDash.call(this, dash); };
          return new Promise((done) => {
            gamms.change({ sensors: true });
            requestAnimationFrame(() => requestAnimationFrame(() => done([...found].sort())));
          });
        })()"""
    )
    assert dashes == [0, 2]


@pytest.fixture(scope="module")
def hilly(tmp_path_factory):
    """A game on hills with a tunnel, between obstacles of all shapes, and the nodes on which sensors report agents."""
    path, covered, rng = tmp_path_factory.mktemp("hilly") / "hilly.ggr", {}, np.random.default_rng(4)
    with gamms.create_context(seed=1, game={"speed_unit": "metres"}) as ctx:
        graph = gamms.graph.grid(9, 9)
        for node, place in graph.nodes(data=True):
            place["z"] = float(rng.integers(0, 40) / 4)
            place["underground"] = int(node % 9 == 4) + 2 * int(node == 10)
        ctx.graph.attach_networkx_graph(graph)
        middles, sizes = rng.uniform(0.0, 80.0, (30, 1, 3)) * (1, 1, 0.15), rng.uniform(-8.0, 8.0, (30, 4, 3))
        walls = [[(25, y, 9), (25, y + 30, 9), (25, y, 0), (25, y + 30, 0)] for y in (12, 52)]
        walls.append([(30, 50, 20), (30, 70, 5), (30, 50, 2), (30, 70, 2)])  # through nodes, below a slope
        ctx.graph.add_obstacles([*walls, *(middles + sizes).tolist()])
        for number in range(20):
            name, node = f"eye {number}", int(rng.integers(81))
            keywords = {"sensor_range": float(rng.uniform(20, 70)), "observer_height": float(rng.uniform(0.5, 9))}
            keywords |= {"fov": 1.5, "orientation": (0.6, 0.8)} if number % 5 == 1 else {}
            keywords |= {0: {"at": (33.0, 41.5)}, 1: {"at": 13}}.get(number, {})
            eye = ctx.sensor.create_sensor(name, "OCCLUDED_AGENT", **keywords)
            flies = {"type": "AERIAL", "position": (52.0, 48.0, 30.0), "speed": 1.0} if number in (2, 3) else {}
            node = {4: 39, 5: 10, 6: 57}.get(number, node)  # in tunnels, and on a wall
            travels = {"speed": 4.0, "strategy": along} if number > 13 else {}  # they are on edges then
            ctx.agent.create_agent(name, start_node_id=node, team=name, sensors={"eye": eye}, **flies, **travels)
        ctx.record.start(path, sensed=True)
        ctx.game.run(1)
        for name, agent in ctx.agent.agents.items():
            node, place = agent.current_node_id, ctx.game.observation(name).get("xy")
            covered[name] = sorted({*agent.sensors["eye"].coverage(place or node).node_ids.tolist(), node})
        ctx.game.step()  # in which the eyes look
        ctx.record.stop()
    return path, covered


def along(state):
    """Go to a neighbour."""
    state["action"] = state["legal"][-1]


def test_fog_past_obstacles_is_that_of_sensors_where_ground_and_obstacles_have_heights(chromium, hilly, tmp_path):
    path, covered = hilly
    with recorder.open(path) as recording:
        recording.save(tmp_path / "hilly.html", turn=1)
    page = chromium.open(tmp_path / "hilly.html")
    replay, scene = "gamms.views[0].replay", "gamms.views[0].scene"
    found = page.value(
        f"{json.dumps(list(covered))}.map((team) => [...{replay}.sight(team).nodes]"
        f".map((row) => {scene}.world.nodeIds[row]))"
    )
    assert dict(zip(covered, map(sorted, found), strict=True)) == covered
    assert len({len(nodes) for nodes in covered.values()}) > 10
    page.value("gamms.change({fog: 'eye 7', sensors: true}), gamms.select('eye 7')")
    page.settle()
    assert page.messages == []


def test_the_memory_of_rules_is_shown(chromium, walled, tmp_path):
    with recorder.open(walled[0]) as recording:
        recording.save(tmp_path / "walled.html", turn=2)
    page = chromium.open(tmp_path / "walled.html", dark=True)
    page.settle()
    before = decode_pixels(page.picture())
    page.value("gamms.select('past')")
    assert "fuel left2" in page.value("document.querySelector('.panel').textContent")
    page.value("gamms.select(null), gamms.panel.close(), gamms.views[0].replay.state.drawings.clear()")
    page.settle()
    page.value("gamms.needsPaint = true")
    page.settle()
    assert (decode_pixels(page.picture()) != before).any(axis=-1).sum() > 500  # rings, squares and bars


def east_for_two_turns(state):
    """Go to the right twice, and stay there."""
    state["action"] = state["curr_pos"] + (state["turn"] < 2)


MEETING = gamms.scenario.Scenario(
    map={"grid": {"width": 6, "height": 1}},
    sensors={"eyes": {"type": "AGENT_RANGE", "sensor_range": 15}},
    teams={
        "herons": {"agents": [{"name": "hera", "node": 1}], "sensors": ["eyes"]},
        "moles": {"agents": [{"name": "mo", "node": 4}], "sensors": ["eyes"]},
    },
    max_turns=3,
)


def test_a_team_has_its_colour_in_files_streams_cuts_and_pictures(chromium, tmp_path):
    path, pixels = tmp_path / "game.ggr", {}
    moves = {"herons": east_for_two_turns, "moles": gamms.strategies.stay}
    with gamms.web.serve(MEETING, speed=None, strategies=moves, record=path) as live:
        live.wait(60)
        pages = {f"live {name}": live.links[name] for name in ("everything", "moles")}
        with recorder.open(path) as recording:
            for name, audience in (("all", None), ("moles", "moles")):
                recording.save(tmp_path / f"{name}.html", audience=audience)
                pages[f"file {name}"] = tmp_path / f"{name}.html"
        for name, place in pages.items():
            page = chromium.open(place)
            page.wait("gamms.turns === 3")
            page.value("gamms.seek(3)")
            page.settle()
            x, y = page.value("(({px, py}) => [px, py])(gamms.views[0].scene.discOf('mo'))")
            pixels[name] = tuple(decode_pixels(page.picture())[round(y), round(x), :3].tolist())
            assert page.messages == []
    with gamms.create_context() as ctx:
        for _ in ctx.record.replay(path):
            pixels["picture"] = ctx.visual.drawing.group_colors()["moles"]
    assert set(pixels.values()) == {(208, 48, 40)}, pixels


def test_the_focus_stays_on_a_menu_of_layers_after_a_choice(page):
    page.value("gamms.seek(3)")
    page.click(*centre(page, "[aria-label='What is shown']"))
    menus = page.value("[...document.querySelectorAll('#look select')].map((one) => one.options.length)")
    assert menus
    for number in range(len(menus)):
        page.value(f"document.querySelectorAll('#look select')[{number}].focus()")
        page.value(
            f"((one) => {{ one.selectedIndex = 1; one.dispatchEvent(new Event('change', {{bubbles: true}})) }})"
            f"(document.querySelectorAll('#look select')[{number}])"
        )
        page.settle()
        assert page.value("document.activeElement.tagName") == "SELECT", number
        chosen = "[...document.querySelectorAll('#look select')].indexOf(document.activeElement)"
        assert page.value(chosen) == number


@pytest.mark.parametrize("has_eyes", [True, False])
def test_views_and_fog_are_offered_where_agents_have_sensors(chromium, tmp_path, has_eyes):
    eyes = {"sensors": {"eyes": {"type": "AGENT_RANGE", "range_m": 20}}} if has_eyes else {}
    teams = {team: {"count": 1, "strategy": "gamms.strategies:random_walk"} | eyes for team in ("red", "blue")}
    game = gamms.scenario.Scenario(map={"grid": {"rows": 4, "columns": 4}}, max_turns=3, teams=teams)
    game.play(1, record=tmp_path / "game.ggr", sensed=True)
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        recording.save(tmp_path / "game.html")
    chromium.open(tmp_path / "game.html")
    offered = chromium.value("[...document.querySelectorAll('#look label > span')].map((one) => one.textContent)")
    assert ("What sensors see" in offered, "Fog of war" in offered) == (has_eyes, has_eyes)
    assert "Heat map" in offered


@pytest.mark.parametrize(("width", "height"), [(390, 800), (800, 600), (1400, 900)])
def test_panels_do_not_overlap_at_any_size(chromium, walk, width, height):
    page = chromium.open(walk, width, height)
    page.value("gamms.select('blue_2')")
    page.click(*centre(page, "[aria-label='What is shown']"))
    page.settle()
    boxes = page.value(
        "['#look', '.panel', '.bar'].map((one) => document.querySelector(one))"
        ".filter((one) => one && one.checkVisibility({visibilityProperty: true}))"
        ".map((one) => (({left, top, right, bottom}) => [left, top, right, bottom])(one.getBoundingClientRect()))"
    )
    for number, one in enumerate(boxes):
        for other in boxes[:number]:
            apart = one[0] >= other[2] or one[2] <= other[0] or one[1] >= other[3] or one[3] <= other[1]
            assert apart, (one, other)
