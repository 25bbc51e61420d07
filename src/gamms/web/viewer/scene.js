// Paint one frame: the map, what teams know, drawings, sensors, trails, agents, messages, names and the scale bar.
import { Camera } from "./camera.js";
import { commandsOf, paintCommands, pointsOf, signBoxes } from "./draw_commands.js";
import { knotsOf, placeOf } from "./labels.js";
import { paintScaleBar, paintWords } from "./lettering.js";
import { MapLayer, NODE } from "./map_layer.js";
import { placeOn } from "./motion.js";
import { Replay } from "./replay.js";
import { paintMessages } from "./messages.js";
import { THEMES, faded, isBright, rgba } from "./themes.js";

const AGENT_LAYER = 20; // artists below it are behind the agents
const SIGN_LAYER = 18; // artists from here on draw signs
const BELOW_PX = 28; // how far signs reach below a disc
const RADIUS = 0.22, MOST_RADIUS = 0.018; // of an agent: in lengths of a typical edge, and at most in widths of the map
const AGENT_PX = 6, LEAST_PX = 3, MANY = 150; // radius of agents; more than so many are smaller
const LARGEST_PX = 12; // radius of agents where a person chooses among nodes that may be close to each other
const MOST_PICTURES = 50;
const SPREAD = [0, 0, 0.7, 0.85, 0.95, 1.0]; // how far so many discs on one node are moved, in radii
const MOST_SPREAD = 6; // of more on one node, one stands for each team, with their number
const MOST_NAMES = 30; // that are shown by themselves
const MOST_SIGNS = 200; // commands of a drawing that names avoid
const MOST_SIGHTS = 20; // agents whose sensors are shown by themselves
const SEEN_ALPHA = 0.35;
const VIRIDIS = ["#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725"];

/**
 * @typedef {object} Look how a scene is to be painted
 * @property {"light" | "dark"} theme @property {string | null} fog the team whose eyes are used @property {number} trails turns
 * @property {boolean | "auto"} labels @property {boolean} sensors @property {boolean} messages
 * @property {string | null} heat "" for visits of all, or a team @property {string | null} selected name of an agent @property {string | null} hovered
 * @typedef {{name: string, px: number, py: number, radius: number, color: string}} Mark what has a name, and how much around it is kept clear
 * @typedef {{name: string, side: string, x: number, y: number, px: number, py: number, radius: number, color: string, way: import("./motion.js").Way}} Disc
 */

export class Scene {
  /** @param {Replay} replay @param {HTMLCanvasElement} canvas */
  constructor(replay, canvas) {
    this.replay = replay;
    this.canvas = canvas;
    this.to = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
    this.world = replay.world;
    this.map = new MapLayer(replay.world);
    this.camera = new Camera(replay.world.box, replay.world.unit);
    this.camera.belowPx = BELOW_PX;
    this.ratio = 1;
    /** @type {Disc[]} */ this.discs = [];
    /** @type {Mark[]} */ this.marks = []; // of agents that are out or were tagged
    /** @type {{lines: string[], box: number[]}[]} */ this.labels = []; // names on the map
    /** @type {WeakMap<object, import("./draw_commands.js").Commands & {theme: string, number: number, turn: number, lasts: boolean}>} */ this.commands = new WeakMap(); // of drawings; `lasts`: they were the same in another turn
    this.drawings = 0; // that were read
    /** @type {Map<string, HTMLCanvasElement>} */ this.pictures = new Map(); // of discs
    /** @type {Map<string, {key: string, canvas: HTMLCanvasElement}>} */ this.caches = new Map();
    /** @type {((scene: Scene) => void) | null} */ this.overlay = null; // paints what a person may choose
    /** @type {Set<string> | null} */ this.visible = null; // names of the agents that the fog leaves
  }

  /** Fit the canvas to its place on the page. */
  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.canvas.width = Math.round(clientWidth * this.ratio);
    this.canvas.height = Math.round(clientHeight * this.ratio);
    this.camera.resize(clientWidth, clientHeight);
  }

  /** Return the colors of all sides. @param {Look} look */
  colors(look) {
    const { colors } = this.replay.state;
    if (this.known?.of !== colors || this.known.theme !== look.theme) {
      this.known = { of: colors, theme: look.theme, colors: new Map([...colors].map(([side, inks]) => [side, rgba(inks.get(look.theme))])) };
    }
    return this.known.colors;
  }

  /**
   * Paint the turn that is shown, after a share of it.
   * @param {Look} look @param {number} share @param {boolean} isMoving whether the camera moves
   * @returns {boolean} whether the map is as sharp as it can be
   */
  paint(look, share, isMoving) {
    const { to, camera, replay, ratio } = this;
    const theme = THEMES[look.theme];
    if (replay.world !== this.world) {
      this.world = replay.world;
      this.map = new MapLayer(replay.world);
    }
    this.#place(look, share);
    to.setTransform(ratio, 0, 0, ratio, 0, 0);
    const colors = this.colors(look);
    const isSharp = this.map.show(to, camera, theme, ratio, isMoving);
    if (look.fog !== null) this.#cached("fog", `${look.fog} ${replay.state.turn} ${look.theme}`, (into) => this.#paintFog(into, look, theme));
    if (look.heat !== null) this.#cached("heat", `${look.heat} ${replay.state.turn}`, (into) => this.#paintHeat(into, look.heat ?? ""));
    const drawings = this.#drawings(look), below = drawings.filter((one) => one.get("layer") < AGENT_LAYER);
    const still = below.filter((one) => !one.get("follows") && !one.has("start"));
    const changed = still.findIndex((one) => !this.#commandsOf(one, look).lasts), lasting = changed < 0 ? still.length : changed;
    this.#paintStill("lasting", still.slice(0, lasting), look);
    this.#paintStill("new", still.slice(lasting), look);
    this.#paintDrawings(to, below.filter((one) => !still.includes(one)), look, share);
    this.#paintTrails(look);
    this.#paintSights(look, colors);
    if (look.messages) paintMessages(to, this, look, share);
    this.#paintAgents(look, theme);
    this.#paintDrawings(to, drawings.filter((one) => !below.includes(one)), look, share);
    this.marks = drawings.flatMap((one) => this.#marksOf(one, colors));
    const signs = drawings.filter((one) => one.get("layer") >= SIGN_LAYER).flatMap((one) => this.#signsOf(one, look));
    this.#paintNames(look, theme, signs);
    if (this.world.isMetric) paintScaleBar(to, camera, theme);
    this.overlay?.(this);
    return isSharp;
  }

  /**
   * Show what is painted again only in another turn, or for another view.
   * @param {string} name @param {string} key @param {(into: CanvasRenderingContext2D) => void} paint
   */
  #cached(name, key, paint) {
    const { camera, ratio } = this;
    const whole = `${key} ${camera.x} ${camera.y} ${camera.scale} ${camera.width} ${camera.height} ${ratio}`;
    const known = this.caches.get(name) ?? { key: "", canvas: document.createElement("canvas") };
    if (known.key !== whole) {
      known.key = whole;
      known.canvas.width = this.canvas.width;
      known.canvas.height = this.canvas.height;
      const into = /** @type {CanvasRenderingContext2D} */ (known.canvas.getContext("2d"));
      into.setTransform(ratio, 0, 0, ratio, 0, 0);
      paint(into);
      this.caches.set(name, known);
    }
    this.to.drawImage(known.canvas, 0, 0, camera.width, camera.height);
  }

  /** The scale at which the surroundings of an agent are seen, some hundred metres. */
  get closeScale() {
    const { camera, world } = this;
    return Math.min(camera.width, camera.height) / (world.isMetric ? 400 : 30 * world.unit);
  }

  /** Return where an agent is painted; undefined if it is not. @param {string} name */
  discOf(name) {
    return this.discs.find((disc) => disc.name === name);
  }

  /** Return the agent at a pixel; null where there is none. @param {number} px @param {number} py @param {number} far */
  agentAt(px, py, far = 12) {
    let [best, least] = [/** @type {Disc | null} */ (null), far];
    for (const disc of this.discs) {
      const distance = Math.hypot(disc.px - px, disc.py - py) - disc.radius;
      if (distance < least) [best, least] = [disc, distance];
    }
    return best;
  }

  /** Work out what the team sees whose eyes are used. @param {Look} look */
  see(look) {
    const { replay } = this;
    const key = `${look.fog} ${replay.state.turn}`;
    if (look.fog === null) this.sightOfTeam = null;
    else if (this.sightKey !== key || this.sightOfTeam === null) this.sightOfTeam = replay.sight(look.fog);
    this.sightKey = key;
    this.visible = this.sightOfTeam?.agents ?? null;
  }

  /** Work out where all agents are painted. @param {Look} look @param {number} share */
  #place(look, share) {
    const { replay, camera } = this;
    this.see(look);
    const colors = this.colors(look);
    const ways = replay.ways.filter((way) => (way.agent.alive || share < 1) && (this.visible === null || this.visible.has(way.name)));
    const least = Math.max(LEAST_PX, Math.min(AGENT_PX, AGENT_PX * Math.sqrt(MANY / Math.max(ways.length, 1))));
    const { box, unit } = replay.world;
    const extent = Math.max(box.right - box.left, box.top - box.bottom) || unit;
    const most = this.overlay === null ? Infinity : LARGEST_PX;
    const radius = Math.max(Math.min(Math.min(RADIUS * unit, MOST_RADIUS * extent) * camera.scale, most), least);
    const starts = spreadOf(ways, (way) => way.before?.row ?? way.agent.row), ends = spreadOf(ways, (way) => way.agent.row);
    this.discs = ways.map((way, i) => {
      const [x, y] = placeOn(way, share);
      const [px, py] = camera.toScreen(x, y);
      const right = (1 - share) * starts[i][0] + share * ends[i][0], down = (1 - share) * starts[i][1] + share * ends[i][1];
      const { side } = way.agent;
      return { name: way.name, side, x, y, px: px + right * radius, py: py + down * radius, radius, color: colors.get(side) ?? "#888888", way };
    }).filter((disc) => Number.isFinite(disc.px));
  }

  /** Veil what a team does not see. @param {CanvasRenderingContext2D} to @param {Look} look @param {import("./themes.js").Theme} theme */
  #paintFog(to, look, theme) {
    const sight = this.sightOfTeam;
    if (look.fog === null || sight === null || sight === undefined) return;
    const { camera, replay, world } = this;
    to.fillStyle = faded(theme.background, 0.72);
    to.fillRect(0, 0, camera.width, camera.height);
    const since = replay.firstSeen(look.fog);
    const shadeOf = (/** @type {number} */ row) => (sight.nodes.has(row) ? 2 : since[row] >= 0 && since[row] <= replay.state.turn ? 1 : 0);
    const paths = [null, new Path2D(), new Path2D()];
    for (const edge of world.streets) {
      const shade = Math.min(shadeOf(world.sources[edge]), shadeOf(world.targets[edge]));
      const path = paths[shade];
      if (path !== null) addLine(path, camera, world.pointsOf(edge));
    }
    [1, 2].forEach((shade) => {
      to.strokeStyle = theme.fog[shade];
      to.lineWidth = Math.max(world.isMetric ? 2 * camera.scale * Math.min(1, 0.1 * world.unit) : 1.5, 1.2);
      to.lineCap = "round";
      to.stroke(/** @type {Path2D} */ (paths[shade]));
    });
    if (world.isMetric) return;
    Array.from(world.nodeIds, (_, row) => row).filter((row) => shadeOf(row)).forEach((row) => {
      to.fillStyle = theme.fog[shadeOf(row)];
      to.beginPath();
      to.arc(...camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]), Math.max(NODE * world.unit * camera.scale, 1.5), 0, 2 * Math.PI);
      to.fill();
    });
  }

  /** Show how often nodes were visited. @param {CanvasRenderingContext2D} to @param {string} side "" for all */
  #paintHeat(to, side) {
    const { camera, replay, world } = this;
    const counts = replay.recording.visits(replay.state.turn, side === "" ? null : side, world.nodeIds.length);
    const most = Math.log1p(counts.reduce((a, b) => Math.max(a, b), 0)) || 1;
    const radius = Math.max(0.5 * world.unit * camera.scale, 2.5);
    const paths = VIRIDIS.map(() => new Path2D());
    for (let row = 0; row < counts.length; row++) {
      if (counts[row] === 0) continue;
      const [x, y] = camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]);
      const path = paths[Math.min(Math.floor((Math.log1p(counts[row]) / most) * VIRIDIS.length), VIRIDIS.length - 1)];
      path.moveTo(x + radius, y);
      path.arc(x, y, radius, 0, 2 * Math.PI);
    }
    paths.forEach((path, step) => {
      to.fillStyle = faded(VIRIDIS[step], 0.75);
      to.fill(path);
    });
  }

  /** Return the drawings that are shown, the lowest first. @param {Look} look @returns {Map<string, any>[]} */
  #drawings(look) {
    const all = [...this.replay.state.drawings.values()];
    return all.filter((one) => look.fog === null || one.get("in_fog")).sort((a, b) => a.get("layer") - b.get("layer"));
  }

  /** Return the commands of a drawing, read once. @param {Map<string, any>} drawing @param {Look} look */
  #commandsOf(drawing, look) {
    let known = this.commands.get(drawing);
    if (known?.theme !== look.theme) {
      known = { ...commandsOf(drawing, look.theme), theme: look.theme, number: ++this.drawings, turn: this.replay.state.turn, lasts: false };
      this.commands.set(drawing, known);
    }
    known.lasts ||= known.turn !== this.replay.state.turn;
    return known;
  }

  /** Paint drawings that are the same in all frames of a turn. @param {string} name @param {Map<string, any>[]} drawings @param {Look} look */
  #paintStill(name, drawings, look) {
    const version = `${drawings.map((one) => this.#commandsOf(one, look).number)} ${look.fog} ${look.fog === null ? "" : this.replay.state.turn}`;
    if (drawings.length) this.#cached(name, version, (into) => this.#paintDrawings(into, drawings, look, 1));
  }

  /** @param {CanvasRenderingContext2D} to @param {Map<string, any>[]} drawings @param {Look} look @param {number} share */
  #paintDrawings(to, drawings, look, share) {
    for (const drawing of drawings) {
      const commands = this.#commandsOf(drawing, look), start = share < 1 && drawing.has("start") ? pointsOf(drawing, drawing.get("start")) : null;
      const points = start !== null ? Float64Array.from(commands.points, (end, i) => start[i] + share * (end - start[i])) : commands.points;
      paintCommands(to, { ...commands, points }, this.camera, this.#shiftOf(drawing, look));
    }
  }

  /** Return how commands of a drawing are moved that belong to agents. @param {Map<string, any>} drawing @param {Look} look @returns {import("./draw_commands.js").Shift} */
  #shiftOf(drawing, look) {
    return (agent, sides, x, y) => {
      if (look.fog !== null && ((sides && !this.replay.sidesOf(look.fog).some((side) => sides.includes(side))) || this.#isHidden(agent))) return null;
      const disc = agent && drawing.get("follows") ? this.discOf(agent) : undefined;
      if (disc === undefined) return [0, 0];
      const [px, py] = this.camera.toScreen(x, y);
      return [disc.px - px, disc.py - py];
    };
  }

  /** Return the boxes of the signs of a drawing. @param {Map<string, any>} drawing @param {Look} look */
  #signsOf(drawing, look) {
    const commands = this.#commandsOf(drawing, look);
    return commands.kind.length > MOST_SIGNS ? [] : signBoxes(commands, this.camera, this.#shiftOf(drawing, look));
  }

  /** Whether the fog hides an agent. @param {string | undefined} name */
  #isHidden(name) {
    return Boolean(name) && this.visible !== null && this.replay.state.agents.has(name ?? "") && !this.visible.has(name ?? "");
  }

  /** Return the marks of a drawing that have names. @param {Map<string, any>} drawing @param {Map<string, string>} colors @returns {Mark[]} */
  #marksOf(drawing, colors) {
    const marks = drawing.get("marks");
    if (marks === undefined) return [];
    const { camera } = this, [places, shifts] = [marks.get("places"), marks.get("shifts")];
    return marks.get("names").map((/** @type {string} */ name, /** @type {number} */ i) => {
      const [px, py] = camera.toScreen(places[2 * i], places[2 * i + 1]);
      const color = colors.get(this.replay.state.agents.get(name)?.side ?? "") ?? "#888888";
      return { name, px: px + shifts[2 * i], py: py + shifts[2 * i + 1], radius: marks.get("radius"), color };
    }).filter((/** @type {Mark} */ mark) => !this.#isHidden(mark.name));
  }

  /** @param {Look} look */
  #paintTrails(look) {
    if (!look.trails) return;
    const { to, camera, replay } = this;
    const trails = replay.trails(look.trails);
    to.lineCap = to.lineJoin = "round";
    for (const { name, way, color, radius, x, y } of this.discs) {
      to.lineWidth = Math.max(0.7 * radius, 2);
      let last = /** @type {[number, number] | null} */ (null);
      for (const { turn, points } of trails.get(name) ?? []) {
        to.strokeStyle = faded(color, Math.max(0.55 * (1 - (replay.state.turn - turn) / (look.trails + 1)), 0.05));
        last = this.#paintWay(points, last);
      }
      to.strokeStyle = faded(color, 0.55);
      this.#paintWay([way.points[0], way.points[1], x, y], last);
    }
  }

  /** Stroke a way, from where the one before it ended; return its end. @returns {[number, number]} */
  #paintWay(/** @type {ArrayLike<number>} */ points, /** @type {[number, number] | null} */ from) {
    const { to, camera } = this;
    to.beginPath();
    to.moveTo(...camera.toScreen(...(from ?? /** @type {[number, number]} */ ([points[0], points[1]]))));
    for (let i = 0; i < points.length; i += 2) to.lineTo(...camera.toScreen(points[i], points[i + 1]));
    to.stroke();
    return [points[points.length - 2], points[points.length - 1]];
  }

  /** Paint what sensors saw: of all agents while they are few, else of those that are looked at. @param {Look} look @param {Map<string, string>} colors */
  #paintSights(look, colors) {
    const { replay, to, camera, world } = this;
    if (replay.sensed === null) return;
    const living = this.discs.filter((disc) => disc.way.agent.alive && (look.fog === null || replay.isOwn(disc.way.agent, look.fog)));
    const chosen = living.filter((disc) => disc.name === look.selected || disc.name === look.hovered);
    const shown = chosen.length ? chosen : look.sensors && living.length <= MOST_SIGHTS ? living : [];
    for (const disc of shown) {
      const color = colors.get(disc.side) ?? "#888888";
      for (const seen of replay.sensed.get(disc.name) ?? []) {
        if (seen.shape !== null) this.#paintShape(disc, seen.shape, color);
        if (seen.isEarly || seen.nodes.length > 0.9 * world.nodeIds.length) continue;
        to.fillStyle = to.strokeStyle = faded(color, SEEN_ALPHA);
        if (seen.agents.length === 0) this.#paintNodes(seen.nodes);
        to.lineWidth = Math.max(3, 0.2 * world.unit * camera.scale);
        to.lineCap = "round";
        const path = new Path2D();
        for (const edge of Array.from(seen.edges)) addLine(path, camera, world.pointsOf(edge));
        to.stroke(path);
        to.strokeStyle = color;
        to.lineWidth = 2;
        for (const { name } of seen.agents) {
          const other = this.discOf(name);
          if (other === undefined || other.side === disc.side) continue;
          to.beginPath();
          to.arc(other.px, other.py, 1.7 * other.radius + 1, 0, 2 * Math.PI);
          to.stroke();
        }
      }
    }
  }

  /** Paint the outline of what a sensor covers, dashed where obstacles may hide something inside. @param {Disc} disc @param {import("./sights.js").Shape} shape @param {string} color */
  #paintShape(disc, { isCarried, isBlocked, points }, color) {
    const { to, camera } = this, far = points.reduce((most, one) => Math.max(most, Math.abs(one)), 0);
    if (isCarried && far * camera.scale > 2 * Math.max(camera.width, camera.height)) return;
    const [x, y] = isCarried ? [disc.x, disc.y] : [0, 0];
    to.beginPath();
    for (let i = 0; i < points.length; i += 2) to.lineTo(...camera.toScreen(x + points[i], y + points[i + 1]));
    to.closePath();
    to.fillStyle = faded(color, 0.07);
    if (!isBlocked) to.fill();
    to.setLineDash(isBlocked ? [5, 4] : []);
    to.strokeStyle = faded(color, isBlocked ? 0.6 : 0.35);
    to.lineWidth = 1;
    to.stroke();
    to.setLineDash([]);
  }

  /** @param {ArrayLike<number>} rows */
  #paintNodes(rows) {
    const { to, camera, world } = this;
    const radius = Math.max(0.11 * world.unit * camera.scale, 2.5);
    to.beginPath();
    for (const row of Array.from(rows)) {
      const [x, y] = camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]);
      to.moveTo(x + radius, y);
      to.arc(x, y, radius, 0, 2 * Math.PI);
    }
    to.fill();
  }

  /** @param {Look} look @param {import("./themes.js").Theme} theme */
  #paintAgents(look, theme) {
    const { to, camera } = this;
    const stacks = stacksOf(this.discs);
    const inView = this.discs.filter(({ px, py }) => px > -50 && py > -50 && px < camera.width + 50 && py < camera.height + 50);
    for (const { name, px, py, radius } of inView) if (name === look.selected || name === look.hovered) this.#ring(px, py, radius + 5, faded(theme.ink, 0.85), 2);
    for (const disc of inView) if (disc.way.agent.flies) this.#paintFlyer(disc, isBright(disc.color) ? "#3c3c3c" : "#ffffff");
    for (const some of inView.length > MANY ? groupsByColor(inView) : inView.map((disc) => [disc])) this.#paintDiscs(some);
    to.textAlign = "center";
    to.textBaseline = "middle";
    for (const { x, y, radius, count } of stacks) {
      to.font = `600 ${Math.max(10, radius)}px system-ui, sans-serif`;
      paintWords(to, String(count), x, y - radius - 8, theme);
    }
    to.textAlign = "left";
  }

  /** Paint discs of one color: of many as copies of one picture, which takes a third of the time. @param {Disc[]} discs */
  #paintDiscs(discs) {
    const { to, ratio } = this;
    const [{ radius, color }] = discs;
    if (discs.length > MANY / 10) {
      const picture = this.#pictureOf(radius, color), half = radius + 1, size = picture.width / ratio;
      for (const { px, py } of discs) to.drawImage(picture, Math.round((px - half) * ratio) / ratio, Math.round((py - half) * ratio) / ratio, size, size);
      return;
    }
    for (const { px, py } of discs) paintDisc(to, px, py, radius, color);
  }

  /** Return the picture of a disc. @param {number} radius @param {string} color @returns {HTMLCanvasElement} */
  #pictureOf(radius, color) {
    const key = `${radius} ${color} ${this.ratio}`;
    const known = this.pictures.get(key);
    if (known !== undefined) return known;
    const made = document.createElement("canvas");
    made.width = made.height = Math.ceil(2 * (radius + 1) * this.ratio);
    const into = /** @type {CanvasRenderingContext2D} */ (made.getContext("2d"));
    into.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    paintDisc(into, radius + 1, radius + 1, radius, color);
    if (this.pictures.size > MOST_PICTURES) this.pictures.clear();
    this.pictures.set(key, made);
    return made;
  }

  /** An agent in the air has a ring around it, and a nose that points where it looks. */
  #paintFlyer(/** @type {Disc} */ { px, py, radius, color, way }, /** @type {string} */ edge) {
    const { heading } = way.agent;
    this.#ring(px, py, 1.8 * radius, edge, 4);
    this.#ring(px, py, 1.8 * radius, color, 2);
    if (heading === null) return;
    for (const [ink, width] of /** @type {[string, number][]} */ ([[edge, 5], [color, 3]])) {
      this.to.beginPath();
      this.to.moveTo(px, py);
      this.to.lineTo(px + 2.6 * radius * Math.cos(heading), py - 2.6 * radius * Math.sin(heading));
      this.to.strokeStyle = ink;
      this.to.lineWidth = width;
      this.to.stroke();
    }
  }

  #ring(/** @type {number} */ x, /** @type {number} */ y, /** @type {number} */ radius, /** @type {string} */ color, /** @type {number} */ width) {
    this.to.beginPath();
    this.to.arc(x, y, radius, 0, 2 * Math.PI);
    this.to.strokeStyle = color;
    this.to.lineWidth = width;
    this.to.stroke();
  }

  /** Write names beside agents, those of a knot as one label, where they cover no agent, sign or other name. @param {Look} look @param {import("./themes.js").Theme} theme @param {number[][]} signs boxes */
  #paintNames(look, theme, signs) {
    const { to, camera } = this;
    const isChosen = (/** @type {{name: string}} */ one) => one.name === look.selected || one.name === look.hovered;
    const areAll = look.labels === true || (look.labels === "auto" && this.discs.length <= MOST_NAMES);
    const chosen = this.discs.filter(isChosen), others = areAll ? [...this.discs.filter((disc) => !isChosen(disc)), ...this.marks] : [];
    const named = [...chosen, ...others].filter(({ px, py }) => px >= 0 && py >= 0 && px <= camera.width && py <= camera.height);
    const discs = this.discs.length <= 300 ? [...this.discs, ...this.marks] : [];
    to.font = "12px system-ui, sans-serif";
    to.textBaseline = "middle";
    to.textAlign = "left";
    const taken = [...signs];
    this.labels = [];
    for (const knot of knotsOf(named)) {
      const lines = knot.map((one) => this.#nameOf(one));
      const place = placeOf(knot, lines.map(({ words }) => to.measureText(words).width), discs, taken, camera, chosen.includes(/** @type {Disc} */ (knot[0])));
      if (place === null) continue;
      const { box, leader, indent } = place;
      taken.push(box);
      this.labels.push({ lines: lines.map(({ words }) => words), box });
      to.strokeStyle = theme.faint;
      to.lineWidth = 1;
      to.beginPath();
      for (const [x, y] of leader) to.lineTo(x, y);
      to.stroke();
      place.middles.forEach((y, i) => {
        const words = i === place.middles.length - 1 && lines.length > i + 1 ? `+${lines.length - i}` : lines[i].words;
        if (indent && !words.startsWith("+")) paintDisc(to, box[0] + 4, y, 3.5, lines[i].color);
        paintWords(to, words, box[0] + indent, y, theme);
      });
    }
  }

  /** Return the name of an agent or a mark, with its height, and its color. */
  #nameOf(/** @type {Mark & {way?: import("./motion.js").Way}} */ { name, color, way }) {
    const z = way?.agent.position?.[2] ?? 0, height = z > 0 ? ` ${z.toFixed(0)} m` : "";
    return { words: (name.length > 24 ? `${name.slice(0, 23)}…` : name) + height, color };
  }
}

/** @param {CanvasRenderingContext2D} to @param {number} x @param {number} y @param {number} radius @param {string} color */
function paintDisc(to, x, y, radius, color) {
  to.beginPath();
  to.arc(x, y, radius, 0, 2 * Math.PI);
  to.fillStyle = color;
  to.fill();
  to.strokeStyle = isBright(color) ? "#3c3c3c" : "#ffffff";
  to.lineWidth = Math.min(1.5, radius / 2);
  to.stroke();
}

/** Add the points of a polyline to a path, in pixels. */
function addLine(/** @type {Path2D} */ path, /** @type {Camera} */ camera, /** @type {ArrayLike<number>} */ points) {
  path.moveTo(...camera.toScreen(points[0], points[1]));
  for (let i = 2; i < points.length; i += 2) path.lineTo(...camera.toScreen(points[i], points[i + 1]));
}

/** Return by how many radii discs are moved right and down, so that those on one node can be told apart. */
function spreadOf(/** @type {import("./motion.js").Way[]} */ ways, /** @type {(way: import("./motion.js").Way) => number} */ nodeOf) {
  /** @type {Map<number, number[]>} */
  const groups = new Map();
  const found = ways.map(() => [0, 0]);
  ways.forEach((way, i) => {
    if (way.agent.flies || way.agent.edge !== null) return;
    const node = nodeOf(way);
    const known = groups.get(node);
    if (known === undefined) groups.set(node, [i]);
    else known.push(i);
  });
  for (const members of groups.values()) {
    if (members.length < 2) continue;
    const sides = [...new Set(members.map((i) => ways[i].agent.side))];
    const isMany = members.length > MOST_SPREAD;
    const slots = isMany ? sides.length : members.length;
    if (slots < 2) continue;
    members.forEach((i, place) => {
      const slot = isMany ? sides.indexOf(ways[i].agent.side) : place;
      const angle = Math.PI * (1 + (2 * slot) / slots) - (slots % 2 ? Math.PI / 2 : 0);
      const far = SPREAD[Math.min(slots, SPREAD.length - 1)];
      found[i] = [far * Math.cos(angle), far * Math.sin(angle)];
    });
  }
  return found;
}

/** Return the discs of each color. @param {Disc[]} discs @returns {Disc[][]} */
function groupsByColor(discs) {
  /** @type {Map<string, Disc[]>} */
  const found = new Map();
  for (const disc of discs) {
    const known = found.get(disc.color);
    if (known === undefined) found.set(disc.color, [disc]);
    else known.push(disc);
  }
  return [...found.values()];
}

/** Return where so many agents of a team stand on one node that one disc stands for them. @param {Disc[]} discs */
function stacksOf(discs) {
  /** @type {Map<number, Disc[]>} */
  const byNode = new Map();
  for (const disc of discs) {
    if (disc.way.agent.flies) continue;
    const known = byNode.get(disc.way.agent.row);
    if (known === undefined) byNode.set(disc.way.agent.row, [disc]);
    else known.push(disc);
  }
  return [...byNode.values()].filter((members) => members.length > MOST_SPREAD).flatMap((members) =>
    groupsByColor(members).filter((some) => some.length > 1).map((some) => ({ x: some[0].px, y: some[0].py, radius: some[0].radius, count: some.length })));
}
