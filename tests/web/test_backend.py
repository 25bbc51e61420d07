"""The viewer paints every draw command as pictures do."""

import base64
import json

import numpy as np
import pytest

import gamms
from gamms import recorder
from gamms.testing import check_backend
from gamms.web.painter import convert_drawing

PAINT = """
(() => {
  const {scene, replay} = gamms.views[0], {camera} = scene, layers = JSON.parse(%s);
  const drawing = ([layer, {commands, colors}]) => {
    const columns = new Map(Object.entries(commands));
    const inks = new Map([["light", Uint8Array.from(colors.light)]]);
    return new Map([["layer", layer], ["commands", columns], ["colors", inks]]);
  };
  replay.state.drawings = new Map(layers.map((one) => [`artist ${one[0]}`, drawing(one)]));
  scene.ratio = 1;
  scene.canvas.width = camera.width = 200;
  scene.canvas.height = camera.height = 100;
  Object.assign(camera, {x: 100, y: 50, scale: 1});
  scene.map.painted = null;
  scene.paint({...gamms.look, theme: "light"}, 1, false);
  const image = scene.to.getImageData(0, 0, 200, 100), {data} = image, paper = [252, 252, 250];
  for (let i = 0; i < data.length; i += 4) if (paper.every((part, k) => data[i + k] === part)) data.fill(255, i, i + 4);
  scene.to.putImageData(image, 0, 0); // the check takes the paper for white
  return scene.canvas.toDataURL("image/png");
})()
"""


@pytest.fixture(scope="module")
def empty(chromium, tmp_path_factory):
    """A page on which nothing is in view."""
    folder = tmp_path_factory.mktemp("empty")
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.add_nodes([0], x=[1e6], y=[1e6])
        ctx.record.start(folder / "empty.ggr")
    with recorder.open(folder / "empty.ggr") as recording:
        recording.save(folder / "empty.html")
    return chromium.open(folder / "empty.html")


def plain(value):
    """Return what JSON holds of arrays."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    return value.ravel().tolist() if isinstance(value, np.ndarray) else value


def test_the_viewer_passes_the_check_of_picture_formats(empty):
    def backend(commands, camera, *, title, background, dpi):
        columns, layers = commands.to_plain(), []
        for layer in np.unique(commands.layer):
            rows = commands.layer == layer
            points = columns["points"][np.repeat(rows, columns["counts"])]
            text = [columns["text"][row] for row in np.flatnonzero(rows)] if "text" in columns else []
            chosen = {name: column[rows] for name, column in columns.items() if name not in ("points", "text")}
            chosen |= {"points": points, "text": text}
            layers.append((int(layer), plain(convert_drawing(chosen, chosen, 2.0**-20))))
        data = empty.value(PAINT % json.dumps(json.dumps(layers)))
        return base64.b64decode(data.partition(",")[2])

    check_backend(backend)
