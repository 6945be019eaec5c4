// Bodies that move: on /learn by their exact motion, beside a simulation by its columns, and where one is played with.
// A picture makes of the coordinates a chain of joints in the plane; a body is drawn at the last one.

export const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
export const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const LOOKS = [["--accent", []], ["--no", [7, 4]], ["--yes", [2, 4]], ["--open", [9, 3, 2, 3]]];

// Lines that coincide are all seen: each is broader than the next above it, and one through the dashes of another.
export const breadth = (k, count) => 1.6 + 2.4 * Math.min(3, count - 1 - k);

const plane = (c) => [c.indexOf("x"), c.indexOf("y")];
const rod = (angle, from = [0, 0], length = 1) => [from[0] + length * Math.sin(angle), from[1] - length * Math.cos(angle)];

// `fits` says for which coordinates a picture can be drawn, `joints` where it is, `drag` what a dragged end means.
export const PICTURES = {
  disk: { label: "rolling disk", fits: (c) => c.length >= 4 && !plane(c).includes(-1), upright: true },
  carriage: { label: "carriage", fits: (c) => c.length >= 4 && !plane(c).includes(-1), upright: true },
  "knife-edge": { label: "knife edge or sleigh", fits: (c) => c.length === 3 && !plane(c).includes(-1) && !c.includes("z"), upright: true },
  pendulum: { label: "pendulum", fits: (c) => c.length === 1, joints: (q) => [[0, 0], rod(q[0])], drag: (q, x, y) => [Math.atan2(x, -y)] },
  spring: { label: "mass on a spring", fits: (c) => c.length === 1, joints: (q) => [[q[0], 0]], drag: (q, x) => [x] },
  "double-pendulum": { label: "double pendulum", fits: (c) => c.length === 2, joints: (q) => [[0, 0], rod(q[0]), rod(q[1], rod(q[0]))],
    drag: (q, x, y) => { const [a, b] = rod(q[0]); return [q[0], Math.atan2(x - a, b - y)]; } },
  polar: { label: "orbit in polar coordinates", fits: (c) => c.length === 2, joints: (q) => [[0, 0], [q[0] * Math.cos(q[1]), q[0] * Math.sin(q[1])]],
    drag: (q, x, y) => [Math.hypot(x, y), Math.atan2(y, x)], centered: true },
  point: { label: "particle in the plane", fits: (c) => c.length === 2 || (!plane(c).includes(-1) && !c.includes("z")) },
  space: { label: "particle in space", fits: (c) => c.length === 3, joints: (q) => [[q[0] - 0.45 * q[1], q[2] - 0.3 * q[1]]] },
  beads: { label: "beads, one for each coordinate", fits: () => true, joints: (q) => q.map((v, k) => [v, -k]), apart: true },
};

// The pictures for these coordinates, the likeliest first.
export function picturesFor(coordinates, angles) {
  const [first, second] = coordinates;
  const likely = [];
  if (coordinates.length === 1) likely.push(angles.includes(first) ? "pendulum" : "spring");
  if (coordinates.length === 2) {
    if (angles.length === 2) likely.push("double-pendulum");
    if (first === "r" || (angles.includes(second) && !angles.includes(first))) likely.push("polar");
    likely.push("point");
  }
  const fitting = Object.keys(PICTURES).filter((name) => PICTURES[name].fits(coordinates));
  return [...new Set([...likely, ...fitting])];
}

// A line through all recorded steps; of a part of them the points, because chords would fill a circle.
export function trace(pen, places, dots) {
  pen.beginPath();
  for (const [u, v] of places) {
    if (dots) pen.rect(u - 0.7, v - 0.7, 1.4, 1.4);
    else pen.lineTo(u, v);
  }
  pen.stroke();
}

export class Stage {
  // `tracks`: [{label, t, q}], q the columns of the coordinates in their order.
  constructor(canvas, { coordinates, picture, tracks, dots = false }) {
    this.canvas = canvas;
    this.dots = dots;
    this.place = 0;
    this.show(coordinates, picture, tracks);
    for (const [target, name] of [[matchMedia("(prefers-color-scheme: dark)"), "change"], [document, "colors"]]) target.addEventListener(name, () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  show(coordinates, picture, tracks) {
    this.coordinates = coordinates;
    this.picture = PICTURES[picture];
    this.name = picture;
    this.tracks = tracks;
    this.frame();
    this.draw();
  }

  joints(q) {
    if (this.picture.joints) return this.picture.joints(q);
    const places = plane(this.coordinates);
    return [(places.includes(-1) ? [0, 1] : places).map((k) => q[k])];
  }

  at(track, k) {
    return this.joints(track.q.map((column) => column[k]));
  }

  frame() {
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const track of this.tracks) {
      track.path = track.t.map((_, k) => this.at(track, k).at(-1));
      for (let k = 0; k < track.t.length; k += 1) for (const [x, y] of this.at(track, k)) {
        if (!Number.isFinite(x + y)) continue;
        left = Math.min(left, x); right = Math.max(right, x); low = Math.min(low, y); high = Math.max(high, y);
      }
    }
    if (!(right >= left)) [left, right, low, high] = [-1, 1, -1, 1];
    this.center = [(left + right) / 2, (low + high) / 2];
    this.size = Math.max(right - left, high - low, 1e-9) * 1.3;
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = width * 0.66;
    if (!width) return;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const scale = Math.min(width, height) / this.size;
    this.toScreen = ([x, y]) => [width / 2 + (x - this.center[0]) * scale, height / 2 - (y - this.center[1]) * scale];
    this.toPlane = ([u, v]) => [this.center[0] + (u - width / 2) / scale, this.center[1] - (v - height / 2) / scale];
    this.grid(pen, width, height, scale);
    const body = Math.min(width, height) * 0.1;
    this.tracks.forEach((track, k) => {
      const last = Math.min(track.t.length - 1, Math.round(this.place * (Math.max(...this.tracks.map((one) => one.t.length)) - 1)));
      const [name, dash] = LOOKS[k % LOOKS.length];
      if (!this.picture.apart) {
        if (!k) this.trail(pen, track.path, track.path.length - 1, color("--line"), [], 1.5);
        this.trail(pen, track.path, last, color(name), dash, breadth(k, this.tracks.length));
      }
      pen.globalAlpha = k ? 0.65 : 1;
      this.body(pen, track, last, body, color(name));
      pen.globalAlpha = 1;
    });
  }

  grid(pen, width, height, scale) {
    pen.strokeStyle = color("--line");
    pen.globalAlpha = 0.5;
    pen.lineWidth = 0.5;
    const step = 10 ** Math.floor(Math.log10(width / scale)) / 2 * scale;
    const [u, v] = this.toScreen([0, 0]);
    for (let at = u % step; at < width; at += step) { pen.beginPath(); pen.moveTo(at, 0); pen.lineTo(at, height); pen.stroke(); }
    for (let at = v % step; at < height; at += step) { pen.beginPath(); pen.moveTo(0, at); pen.lineTo(width, at); pen.stroke(); }
    pen.globalAlpha = 1;
  }

  trail(pen, path, last, ink, dash, width) {
    pen.strokeStyle = ink;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    trace(pen, path.slice(0, last + 1).map(this.toScreen), this.dots);
    pen.setLineDash([]);
  }

  body(pen, track, k, size, ink) {
    const joints = this.at(track, k).map(this.toScreen);
    pen.lineWidth = 2;
    pen.strokeStyle = color("--ink");
    pen.fillStyle = ink;
    if (this.picture.upright) {
      // The first coordinate is the heading, the second, where there are four, the angle of rolling.
      const q = track.q.map((column) => column[k]);
      pen.save();
      pen.translate(...joints[0]);
      pen.rotate(-q[0]);
      pen.fillStyle = color("--accent-wash");
      ({ disk, carriage, "knife-edge": blade })[this.name](pen, size, q[1]);
      pen.restore();
      return;
    }
    if (this.name === "spring") this.spring(pen, joints[0]);
    if (joints.length > 1 && !this.picture.apart && !this.picture.centered) {
      pen.beginPath();
      for (const joint of joints) pen.lineTo(...joint);
      pen.stroke();
    }
    joints.forEach((joint, j) => {
      const pivot = !j && joints.length > 1 && !this.picture.apart;
      pen.beginPath();
      pen.arc(...joint, pivot ? 4 : 8, 0, 2 * Math.PI);
      pen.fillStyle = pivot ? color("--ink") : ink;
      pen.fill();
    });
  }

  spring(pen, [u, v]) {
    const from = this.toScreen([this.center[0] - this.size * 0.55, 0])[0];
    pen.beginPath();
    pen.moveTo(from, v);
    for (let k = 1; k < 24; k += 1) pen.lineTo(from + ((u - from) * k) / 24, v + (k % 2 ? 7 : -7));
    pen.lineTo(u, v);
    pen.stroke();
  }
}

function oval(pen, size) {
  pen.beginPath();
  pen.ellipse(0, 0, size, size * 0.3, 0, 0, 2 * Math.PI);
  pen.fill();
  pen.stroke();
}

function spokes(pen, size, rolled) {
  for (let spoke = 0; spoke < 3; spoke += 1) {
    const angle = rolled + (spoke * 2 * Math.PI) / 3;
    pen.strokeStyle = spoke ? color("--soft") : color("--no");
    pen.lineWidth = spoke ? 1 : 2.5;
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.lineTo(size * Math.cos(angle), size * 0.3 * Math.sin(angle));
    pen.stroke();
  }
}

// An upright disk seen from above and a little from the side: an ellipse with a mark that turns.
function disk(pen, size, rolled = 0) {
  oval(pen, size);
  spokes(pen, size, rolled);
}

function carriage(pen, size, rolled = 0) {
  pen.fillRect(-size * 0.5, -size * 0.5, size * 1.2, size);
  pen.strokeRect(-size * 0.5, -size * 0.5, size * 1.2, size);
  for (const side of [-0.75, 0.75]) {
    pen.save();
    pen.translate(0, side * size);
    oval(pen, size * 0.5);
    spokes(pen, size * 0.5, rolled);
    pen.restore();
    pen.strokeStyle = color("--ink");
    pen.lineWidth = 2;
  }
}

function blade(pen, size) {
  pen.beginPath();
  pen.moveTo(-size, 0);
  pen.quadraticCurveTo(0, -size * 0.28, size, 0);
  pen.quadraticCurveTo(0, size * 0.28, -size, 0);
  pen.fill();
  pen.stroke();
  pen.strokeStyle = color("--no");
  pen.beginPath();
  pen.moveTo(0, 0);
  pen.lineTo(size, 0);
  pen.stroke();
}

// A slider that plays: `moved` is told the place between 0 and 1.
export function player(figure, moved) {
  const slider = figure.querySelector("input[type=range]");
  const button = figure.querySelector("[data-play]");
  let playing = false;
  const set = (value) => { slider.value = Math.min(1, Math.max(0, value)); moved(Number(slider.value)); };
  const stop = () => { playing = false; button.textContent = "Play"; };
  const play = () => {
    playing = true;
    button.textContent = "Pause";
    if (Number(slider.value) >= 0.999) slider.value = 0;
    let before = performance.now();
    const step = (now) => {
      if (!playing) return;
      const next = Number(slider.value) + (now - before) / 9000;
      before = now;
      set(next);
      if (next >= 1) stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  };
  slider.addEventListener("input", () => { stop(); moved(Number(slider.value)); });
  // An arrow moves by a fiftieth: the browser's own step is one of a thousand. The space bar plays.
  slider.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 0.02, ArrowUp: 0.02, ArrowLeft: -0.02, ArrowDown: -0.02 }[event.key];
    if (event.key === " ") button.click();
    else if (by) { stop(); set(Number(slider.value) + by); } else return;
    event.preventDefault();
  });
  button.addEventListener("click", () => (playing ? stop() : play()));
  moved(Number(slider.value));
  return play;
}

export function choices(select, names) {
  select.replaceChildren(...names.map((name) => new Option(PICTURES[name]?.label ?? name, name)));
  select.closest("label, span").hidden = names.length < 2;
}

function exact(kind) {
  const t = Array.from({ length: 721 }, (_, k) => (k / 720) * 2 * Math.PI);
  const roll = 1.6;
  const path = [t, t.map((s) => roll * s), t.map((s) => roll * Math.sin(s)), t.map((s) => roll * (kind === "disk" ? 1 - Math.cos(s) : -Math.cos(s)))];
  return { coordinates: ["phi", "theta", "x", "y"], tracks: [{ label: "", t, q: path }], pictures: [kind] };
}

for (const figure of document.querySelectorAll("[data-motion]")) {
  const data = figure.querySelector("script[type='application/json']");
  const told = data ? JSON.parse(data.textContent) : exact(figure.dataset.motion);
  const pictures = told.pictures ?? picturesFor(told.coordinates, told.angles);
  const select = figure.querySelector("[data-picture]");
  const stage = new Stage(figure.querySelector("canvas"), { ...told, picture: pictures[0] });
  const slider = figure.querySelector("input[type=range]");
  const longest = told.tracks.reduce((a, b) => (b.t.length > a.t.length ? b : a));
  const play = player(figure, (place) => {
    stage.place = place;
    slider.setAttribute("aria-valuetext", `t = ${longest.t[Math.round(place * (longest.t.length - 1))].toPrecision(3)}`);
    stage.draw();
  });
  if (select) {
    choices(select, pictures);
    select.addEventListener("change", () => stage.show(told.coordinates, select.value, stage.tracks));
  }
  for (const box of figure.querySelectorAll("[data-track]")) {
    box.addEventListener("change", () => {
      const wanted = [...figure.querySelectorAll("[data-track]")].filter((one) => one.checked).map((one) => Number(one.dataset.track));
      stage.show(told.coordinates, stage.name, told.tracks.filter((_, k) => wanted.includes(k)));
    });
  }
  if (!calm() && figure.hasAttribute("data-autoplay")) play();
}
