// The moving picture of an answer: a body on its path, or a mass above its phase portrait; sliders, a start to drag.
// A picture makes of the coordinates a chain of joints in the plane; the path is that of the last one.

import { System, run } from "./system.js";

export const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
const STEP = 0.02; // of the drawn curve, classical Runge-Kutta in two parts
const STEPS = 1500; // of a phase portrait; a path has half of them
const FAR = 60; // of a coordinate: the path beyond is not drawn
const SPEED = 1.4; // of the motion's time in s
const [WIDTH, HEIGHT] = [408, 384];
const DIALS = 3; // in a row
// Positions and velocities of the first coordinates, the last of each for all others.
const STARTS = [[[1.5, 0.5, 0.2], [0.5, 0.8, 0.3]], [[0.1, 0], [1, 1, 0]], [[1, 0.5, 0.2], [0.1, 1, 0.3]], [[1, 0.3, 0.1], [0.2, 0.4, 0.1]],
  [[0.5, 0.2, 0.1], [0.1, 0.2, 0.3]], [[3, 1, 0.5], [0.1, 0.5, 0.2]], [[-1, -0.5, -0.2], [-0.1, -0.3, 0.2]], [[0.2, -0.3, 0.1], [-0.05, 0.1, 0.07]]];

const plane = (c) => [c.indexOf("x"), c.indexOf("y")];
const rod = (angle, from = [0, 0], length = 1) => [from[0] + length * Math.sin(angle), from[1] - length * Math.cos(angle)];

// `fits` says for which coordinates a picture can be drawn, `joints` where it is, `drag` what a dragged end means.
export const PICTURES = {
  disk: { label: "rolling disk", fits: (c) => c.length >= 4 && !plane(c).includes(-1), upright: true },
  carriage: { label: "carriage", fits: (c) => c.length >= 4 && !plane(c).includes(-1), upright: true },
  "knife-edge": { label: "knife edge or sleigh", fits: (c, angles) => c.length === 3 && !plane(c).includes(-1) && angles.length === 1, upright: true },
  pendulum: { label: "pendulum", fits: (c) => c.length === 1, joints: (q) => [[0, 0], rod(q[0])], drag: (q, x, y) => [Math.atan2(x, -y)] },
  spring: { label: "mass on a spring", fits: (c) => c.length === 1, joints: (q) => [[q[0], 0]], drag: (q, x) => [x] },
  "double-pendulum": { label: "double pendulum", fits: (c) => c.length === 2, joints: (q) => [[0, 0], rod(q[0]), rod(q[1], rod(q[0]))],
    drag: (q, x, y) => { const [a, b] = rod(q[0]); return [q[0], Math.atan2(x - a, b - y)]; } },
  polar: { label: "orbit in polar coordinates", fits: (c) => c.length === 2, joints: (q) => [[0, 0], [q[0] * Math.cos(q[1]), q[0] * Math.sin(q[1])]],
    drag: (q, x, y) => [Math.hypot(x, y), Math.atan2(y, x)], centered: true },
  cart: { label: "pendulum on a slide", fits: (c, angles) => c.length === 2 && angles.includes(c[1]) && !angles.includes(c[0]),
    joints: (q) => [[q[0], 0], rod(q[1], [q[0], 0])], drag: (q, x, y) => [q[0], Math.atan2(x - q[0], -y)] },
  point: { label: "particle in the plane", fits: (c) => c.length === 2 || !plane(c).includes(-1), axes: true },
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
    if (["r", "rho", "R"].includes(first)) likely.push("polar"); // an x with an angle is no radius
    likely.push("point");
  }
  const fitting = Object.keys(PICTURES).filter((name) => PICTURES[name].fits(coordinates, angles));
  return [...new Set([...likely, ...fitting])];
}

const fixed = (number) => number.toFixed(1);
const line = (points) => (points.length ? `M${points.map(([u, v]) => `${fixed(u)} ${fixed(v)}`).join("L")}` : "");
const short = (number) => String(Number(number.toPrecision(3))).replace("-", "\u2212");
const escaped = (text) => text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);

// How each body looks: `at` are its joints on the screen, `q` its coordinates.
function zigzag([u, v], [x, y], half = 8, turns = 9) {
  const [dx, dy] = [x - u, y - v];
  const size = Math.hypot(dx, dy) || 1;
  const points = [[u, v]];
  for (let k = 0; k < 2 * turns; k += 1) {
    const [along, side] = [(k + 0.5) / (2 * turns), k % 2 ? half : -half];
    points.push([u + dx * along - (dy / size) * side, v + dy * along + (dx / size) * side]);
  }
  return line([...points, [x, y]]);
}

const upright = {
  disk: (rolled) => `<ellipse class="fill" rx="26" ry="8"/>${[0, 1, 2].map((k) => { const a = rolled + (2 * Math.PI * k) / 3; return `<path class="${k ? "thin" : "mark"}" d="M0 0L${fixed(26 * Math.cos(a))} ${fixed(8 * Math.sin(a))}"/>`; }).join("")}`,
  carriage: (rolled) => `<rect class="fill" x="-12" y="-12" width="28" height="24" rx="3"/><g transform="translate(0 -18)scale(.5)">${upright.disk(rolled)}</g><g transform="translate(0 18)scale(.5)">${upright.disk(rolled)}</g>`,
  "knife-edge": () => '<path class="fill" d="M-20 0Q0 -8 22 0Q0 8 -20 0Z"/><path class="mark" d="M0 0H22"/>',
};

function drawn(name, at, q, origin) {
  const [u, v] = at.at(-1);
  if (upright[name]) return `<g transform="translate(${fixed(u)} ${fixed(v)})rotate(${fixed((-q[0] * 180) / Math.PI)})">${upright[name](q[1])}</g>`;
  const ball = ([x, y], size = 8) => `<circle class="body" cx="${fixed(x)}" cy="${fixed(y)}" r="${size}"/>`;
  if (name.endsWith("pendulum")) return `<path class="rod" d="${line(at)}"/><circle class="pivot" cx="${fixed(at[0][0])}" cy="${fixed(at[0][1])}" r="3"/>${at.slice(1).map((one) => ball(one)).join("")}`;
  if (name === "polar") return `<circle class="pivot" cx="${fixed(origin[0])}" cy="${fixed(origin[1])}" r="6"/>${ball(at.at(-1), 6)}`;
  return at.map((one) => ball(one, 6)).join("");
}

// What is drawn once, and moved after that.
const LAYERS = '<g data-axes></g><g data-near></g><path class="future" data-all></path><path class="past" data-done></path><path class="plumb" data-plumb></path><g data-body></g><g class="hand" data-hand tabindex="0" role="slider" aria-label="Start. Arrow keys move it." aria-valuemin="-100" aria-valuemax="100" aria-valuenow="0"><circle r="22" class="reach"/><circle r="7.5" class="ring"/><text class="drag" x="14" y="-13">drag the start</text></g><circle class="dot" r="5.5" data-dot></circle>';

export class Motion {
  // `told`: coordinates, labels, equations, constraints, values, angles and the other data that the service sends.
  // `tracks` of a computed motion [{t, q}] take the place of the equations; `small` leaves out dials and handle.
  constructor(figure, told, { small = false, changed = null } = {}) {
    Object.assign(this, { figure, told, small, changed, place: 0, hold: 0 });
    this.svg = figure.querySelector("svg");
    this.n = told.coordinates.length;
    this.names = picturesFor(told.coordinates, told.angles);
    this.name = this.names.includes(told.picture) ? told.picture : this.names[0];
    this.svg.innerHTML = LAYERS;
    this.part = Object.fromEntries(["axes", "near", "all", "done", "plumb", "body", "hand", "dot"].map((key) => [key, this.svg.querySelector(`[data-${key}]`)]));
    this.button = figure.querySelector("[data-play]");
    this.now = figure.querySelector("[data-now]");
    this.said = figure.querySelector("[data-said]");
    if (told.tracks) {
      this.part.hand.remove();
      for (const track of told.tracks) track.v ??= track.q.map((q) => q.map((_, k) => { const [a, b] = [Math.max(0, k - 1), Math.min(q.length - 1, k + 1)]; return (q[b] - q[a]) / (track.t[b] - track.t[a]); }));
    } else {
      this.system = new System(told);
      this.values = { ...told.values };
      this.guessValues();
      this.begin();
      if (small) this.part.hand.remove();
      else { this.handle(); this.dials(); }
    }
    this.update(true);
    this.button?.addEventListener("click", () => this.play(!this.playing));
    this.play(!calm());
  }

  get isPhase() { return this.n === 1; }

  // Where the picture of a state is, in its own plane.
  joints(q) {
    const picture = PICTURES[this.name];
    if (picture.joints) return picture.joints(q);
    const places = plane(this.told.coordinates);
    return [(places.includes(-1) ? [0, 1] : places).map((k) => q[k])];
  }

  point(track, k) {
    return this.isPhase ? [track.q[0][k], track.v[0][k]] : this.joints(track.q.map((column) => column[k])).at(-1);
  }

  // Damping is small by default: f depends on v through it alone. A mass that f divides by is not let go to zero.
  guessValues() {
    const { system } = this;
    this.ranges = {};
    const spread = (values) => {
      const state = system.state(Array(this.n).fill(0.7), Array(this.n).fill(0.4), values);
      let sum = 0;
      for (let k = 0; k < this.n; k += 1) {
        const before = system.f[k](state);
        state[this.n + k] += 0.01;
        sum += (system.f[k](state) - before) / 0.01;
        state[this.n + k] -= 0.01;
      }
      return sum;
    };
    const all = { ...this.values };
    for (const name of Object.keys(this.values)) {
      const none = { ...all, [name]: 0 };
      const isSingular = !system.f.every((f) => Math.abs(f(system.state(Array(this.n).fill(0.7), Array(this.n).fill(0.4), none))) < 1e6);
      const damps = !isSingular && !system.w.length && spread(all) < -1e-9 && Math.abs(spread(none)) < 1e-9;
      if (damps && this.told.given?.[name] === undefined) this.values[name] = 0.35;
      this.ranges[name] = [isSingular ? 0.2 : Math.min(0, 2 * this.values[name]), Math.max(3, Math.ceil(2 * this.values[name])), damps ? "damping " : ""];
    }
  }

  begin() {
    const free = this.told.free ?? this.told.coordinates;
    const candidates = this.told.start ? [[this.told.start.positions, this.told.start.velocities]] : STARTS.map(([q, v]) => [this.told.coordinates.map((_, k) => q[Math.min(k, q.length - 1)]),
      this.told.coordinates.map((name) => { const k = free.indexOf(name); return k < 0 ? NaN : v[Math.min(k, v.length - 1)]; })]);
    let best = -1;
    for (const [q, v] of candidates) {
      const lasted = this.lasts(q, v);
      if (lasted > best + 20) [best, this.q, this.v] = [lasted, q, v];
    }
    this.q = [...this.q];
    this.v = [...this.v];
  }

  // For how many steps a motion stays near and on its side of what the answer needs.
  lasts(q, v) {
    const start = this.system.state(q, this.system.completed(q, v, this.values), this.values);
    const sides = this.system.sides.map((side) => side(start));
    if (this.told.signs?.some((sign, k) => (sign ? !(sides[k] > 0) : !sides[k]))) return 0;
    let lasted = 0;
    run(this.system, start, 0.05, 300, 1, (state) => {
      if (this.system.sides.every((side, k) => side(state) * sides[k] > 0) && state.slice(0, this.n).every((x) => Math.abs(x) < FAR)) lasted += 1;
    });
    return lasted;
  }

  track(q, v, steps = Math.round(Math.min(4000, this.told.span ? this.told.span / STEP : this.isPhase ? STEPS : STEPS / 2))) {
    const start = this.system.state(q, this.system.completed(q, v, this.values), this.values);
    const found = run(this.system, start, STEP, steps, 2);
    let end = found.t.length;
    const isFar = (k) => found.q.some((column) => Math.abs(column[k]) > FAR);
    for (let k = 0; k < end; k += 1) if (isFar(k)) end = k;
    if (this.isPhase && !this.told.span && end > 200) { // what has died out is not drawn
      const [top, fast] = [Math.max(...found.q[0].map(Math.abs)), Math.max(...found.v[0].map(Math.abs)) || 1];
      while (end > 200 && Math.hypot(found.q[0][end - 1] / top, found.v[0][end - 1] / fast) < 0.02) end -= 1;
    }
    return { t: found.t.slice(0, end), q: found.q.map((c) => c.slice(0, end)), v: found.v.map((c) => c.slice(0, end)), stopped: found.stopped };
  }

  // After a slider or the start was moved; `settled` fits the frame to the present paths.
  update(settled) {
    this.main = this.told.tracks?.[0] ?? this.track(this.q, this.v);
    this.points = this.main.t.map((_, k) => this.point(this.main, k));
    if (this.points.length < 2) {
      this.say(`There is no motion from this start.`);
      return;
    }
    const stopped = this.main.stopped !== undefined;
    this.say(stopped ? `no value from t = ${short(this.main.stopped)} on` : this.told.tracks ? "" : "by Runge\u2013Kutta");
    this.fit(settled);
    this.scene();
    this.place = 0;
    this.hold = 0;
    this.draw();
  }

  say(text) { if (this.said) this.said.textContent = text; }

  fit(settled) {
    const box = [Infinity, -Infinity, Infinity, -Infinity];
    const take = ([x, y]) => {
      if (!Number.isFinite(x + y)) return;
      box[0] = Math.min(box[0], x); box[1] = Math.max(box[1], x); box[2] = Math.min(box[2], y); box[3] = Math.max(box[3], y);
    };
    this.points.forEach(take);
    if (!this.isPhase) for (let k = 0; k < this.main.t.length; k += 7) this.joints(this.main.q.map((column) => column[k])).forEach(take);
    if (this.isPhase) [-1, 1].forEach((s) => take([s * 0.2 * box[1], s * 0.2 * box[3]])); // a little of both axes
    if (!settled && this.box) box.forEach((value, k) => (box[k] = k % 2 ? Math.max(value, this.box[k]) : Math.min(value, this.box[k])));
    this.box = box;
    const [top, bottom] = this.isPhase ? [92, 368] : [24, HEIGHT - 24];
    const [left, right] = [this.isPhase ? 34 : 30, WIDTH - 34];
    const size = (low, high) => Math.max(high - low, 1e-9) * 1.08;
    let [a, b] = [(right - left) / size(box[0], box[1]), (bottom - top) / size(box[2], box[3])];
    if (!this.isPhase && !(this.box[1] - this.box[0] > 1e-9)) a = b;
    if (!this.isPhase && !(this.box[3] - this.box[2] > 1e-9)) b = a;
    if (!this.isPhase) a = b = Math.min(a, b);
    const [x, y] = [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2];
    this.toScreen = ([p, q]) => [(left + right) / 2 + (p - x) * a, (top + bottom) / 2 - (q - y) * b];
    this.toPlane = ([u, v]) => [x + (u - (left + right) / 2) / a, y - (v - (top + bottom) / 2) / b];
    this.area = { top, bottom, left, right };
  }

  // Axes, the whole path, its neighbors, the handle.
  scene() {
    const picture = PICTURES[this.name];
    this.screen = this.points.map(this.toScreen);
    this.part.all.setAttribute("d", line(this.screen.filter((_, k) => k % 2 === 0)));
    this.part.axes.innerHTML = this.isPhase || picture.axes ? this.axes() : "";
    const isPlain = this.isPhase && !this.told.tracks && !this.small;
    this.part.near.innerHTML = !isPlain ? "" : [0.45, 0.75, 1.25].map((s) => {
      const [x, v] = [(this.box[0] + this.box[1]) / 2, (this.box[2] + this.box[3]) / 2];
      const near = this.track([x + s * (this.q[0] - x)], [v + s * (this.v[0] - v)], 500);
      const parts = [[]]; // what leaves the picture is not joined to what comes back
      near.t.forEach((_, k) => {
        const [u, w] = this.toScreen([near.q[0][k], near.v[0][k]]);
        if (u > 4 && u < WIDTH - 4 && w > this.area.top - 8 && w < HEIGHT - 4) parts.at(-1).push([u, w]);
        else if (parts.at(-1).length) parts.push([]);
      });
      return `<path d="${parts.map(line).join("")}"/>`;
    }).join("");
    if (this.told.tracks) return;
    const [u, v] = this.screen[0];
    this.part.hand.setAttribute("transform", `translate(${fixed(u)} ${fixed(v)})`);
    const text = this.part.hand.querySelector("text");
    // Its name is placed off the path.
    const ahead = this.screen.slice(1, 2 + this.screen.length / 12);
    const [du, dv] = [0, 1].map((k) => ahead.reduce((sum, at) => sum + at[k] - this.screen[0][k], 0));
    const isLeft = u > WIDTH - 110 || (du > 0 && u > 110);
    text?.setAttribute("text-anchor", isLeft ? "end" : "start");
    text?.setAttribute("x", isLeft ? -14 : 14);
    text?.setAttribute("y", dv > 0 ? -13 : 24);
    const said = this.told.coordinates.map((name, k) => `${this.called(name)} ${short(this.q[k])}`).join(", ");
    this.part.hand.setAttribute("aria-valuetext", said);
    this.part.hand.setAttribute("aria-valuenow", Math.round(100 * ((u - this.area.left) / (this.area.right - this.area.left) - 0.5)));
  }

  called(name) { return this.told.labels?.[name] ?? name; }

  axes() {
    const { left, right, top, bottom } = this.area;
    const [ou, ov] = this.toScreen([0, 0]);
    const [u, v] = [Math.min(right, Math.max(left, ou)), Math.min(bottom, Math.max(top, ov))];
    const [first, second] = this.isPhase ? [this.called(this.told.coordinates[0]), null] : plane(this.told.coordinates).includes(-1) ? this.told.coordinates.map((name) => this.called(name)) : ["x", "y"];
    const nice = (range) => { const power = 10 ** Math.floor(Math.log10(range / 2.4)); return [5, 2, 1].map((k) => k * power).find((k) => k <= range / 2.4) ?? power; };
    const ticks = [];
    const [low, high] = [this.toPlane([left, bottom]), this.toPlane([right, top])]; // what is seen, not what the path fills
    for (const axis of [0, 1]) {
      const step = nice(high[axis] - low[axis]);
      for (let k = Math.ceil(low[axis] / step); k * step <= high[axis]; k += 1) if (k) {
        const [p, q] = this.toScreen(axis ? [0, k * step] : [k * step, 0]);
        ticks.push(axis ? `<path d="M${fixed(u - 4)} ${fixed(q)}h8"/><text text-anchor="end" x="${fixed(u - 8)}" y="${fixed(q + 4)}">${short(k * step)}</text>`
          : `<path d="M${fixed(p)} ${fixed(v - 4)}v8"/><text text-anchor="middle" x="${fixed(p)}" y="${fixed(v + 20)}">${short(k * step)}</text>`);
      }
    }
    const dotted = second ? escaped(second) : `${escaped(first)}\u0307`;
    return `<path d="M${left - 14} ${fixed(v)}H${right + 8}M${fixed(u)} ${top - 6}V${bottom + 6}"/>${ticks.join("")}<text class="name" x="${right + 10}" y="${fixed(v - 8)}" text-anchor="end">${escaped(first)}</text><text class="name" x="${fixed(u + 9)}" y="${top + 4}">${dotted}</text>`;
  }

  draw() {
    const last = this.points.length - 1;
    const k = Math.min(last, Math.round(this.place / (this.main.t[1] - this.main.t[0])));
    const [u, v] = this.screen[k];
    this.part.done.setAttribute("d", line(this.screen.slice(0, k + 1)));
    this.part.dot.setAttribute("cx", fixed(u));
    this.part.dot.setAttribute("cy", fixed(v));
    this.part.dot.classList.toggle("hidden", !this.isPhase);
    const q = this.main.q.map((column) => column[k]);
    if (this.isPhase) this.above(u, v, q[0]);
    else this.part.body.innerHTML = drawn(this.name, this.joints(q).map(this.toScreen), q, this.toScreen([0, 0]));
    if (this.now) this.now.textContent = `t = ${this.main.t[k].toFixed(1)}`;
  }

  // Over the phase portrait: the mass above its point, on the same axis; a pendulum hangs.
  above(u, v, q) {
    if (this.name === "pendulum") {
      const at = [[204, 14], rod(q, [204, 14], -52).map((value, k) => (k ? value : 408 - value))];
      this.part.body.innerHTML = `<path class="rod" d="M180 14H228"/>${drawn("pendulum", at, [q])}`;
      return;
    }
    const left = Math.max(40, u - 18);
    const damper = Object.keys(this.values ?? {}).some((name) => this.ranges[name]?.[2] && this.values[name]);
    const middle = 14 + (left - 14) / 2;
    this.part.body.innerHTML = `<path class="rule" d="M14 18V70H398"/><path class="rod" d="${zigzag([14, damper ? 38 : 44], [left, damper ? 38 : 44])}"/>${damper ? `<path class="rod" d="M14 60H${fixed(middle - 9)}M${fixed(middle + 9)} 55H${fixed(middle - 9)}V65H${fixed(middle + 9)}M${fixed(middle + 2)} 56V64M${fixed(middle + 2)} 60H${fixed(left)}"/>` : ""}<rect class="body" x="${fixed(left)}" y="26" width="36" height="43" rx="4"/>`;
    this.part.plumb.setAttribute("d", `M${fixed(u)} 70V${fixed(v)}`);
  }

  play(on) {
    this.playing = on;
    if (this.button) this.button.textContent = on ? "Pause" : "Play";
    if (!on || this.ticking) return;
    this.ticking = true;
    let before = performance.now();
    const step = (time) => {
      const passed = Math.min(0.05, Math.max(0, (time - before) / 1000));
      before = time;
      if (!this.playing || !this.svg.isConnected) { this.ticking = false; return; }
      const end = this.main.t.at(-1) - this.main.t[0];
      if (this.points.length > 1 && this.svg.getClientRects().length) {
        if (this.place < end) this.place += passed * Math.max(SPEED, end / 24);
        else if ((this.hold += passed) > 1.2) { this.place = 0; this.hold = 0; }
        this.draw();
      }
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  // The start, dragged or moved by keys.
  handle() {
    const { hand } = this.part;
    const picture = PICTURES[this.name];
    const places = plane(this.told.coordinates).includes(-1) ? [0, 1] : plane(this.told.coordinates);
    if (!this.isPhase && !picture.drag && picture.joints) { hand.remove(); return; }
    const put = (at, settled) => {
      const [x, y] = this.toPlane(at);
      if (this.isPhase) { this.q = [x]; this.v = [y]; } else if (picture.drag) this.q = picture.drag(this.q, x, y);
      else { this.q[places[0]] = x; this.q[places[1]] = y; }
      hand.querySelector("text")?.remove();
      this.update(settled);
      this.changed?.();
    };
    const from = (event) => { const box = this.svg.getBoundingClientRect(); return [((event.clientX - box.left) * WIDTH) / box.width, ((event.clientY - box.top) * HEIGHT) / box.height]; };
    let drags = false;
    hand.addEventListener("pointerdown", (event) => { hand.setPointerCapture(event.pointerId); drags = true; hand.focus(); event.preventDefault(); });
    hand.addEventListener("pointermove", (event) => { if (drags) put(from(event), false); });
    for (const name of ["pointerup", "pointercancel"]) hand.addEventListener(name, () => { if (drags) this.update(true); drags = false; });
    hand.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
      if (!by) return;
      event.preventDefault();
      put(this.screen[0].map((value, k) => value + by[k]), true);
    });
  }

  dials() {
    const place = this.figure.querySelector("[data-dials]");
    if (!place) return;
    const add = (label, value, [low, high], moved) => {
      const dial = document.createElement("label");
      dial.className = "slide";
      dial.innerHTML = `<span>${escaped(label)} <output></output></span><input type="range" min="${low}" max="${high}" step="0.05">`;
      const [slider, output] = [dial.querySelector("input"), dial.querySelector("output")];
      const show = () => (output.textContent = short(Number(slider.value)));
      slider.setAttribute("aria-label", label); // a label with an output in it names that
      slider.value = value;
      show();
      slider.addEventListener("input", (event) => { event.stopPropagation(); show(); moved(Number(slider.value)); this.update(false); this.changed?.(); });
      slider.addEventListener("change", () => this.update(true));
      place.append(dial);
    };
    const parameters = Object.keys(this.values).slice(0, 2 * DIALS);
    for (const name of parameters) add(`${this.ranges[name][2]}${this.called(name)}`, this.values[name], this.ranges[name], (value) => (this.values[name] = value));
    if (this.isPhase) return;
    const free = this.told.coordinates.map((_, k) => k).filter((k) => !Number.isNaN(this.v[k]));
    for (const k of free.slice(0, Math.max(0, DIALS - parameters.length))) add(`${this.called(this.told.coordinates[k])}\u2032 at the start`, this.v[k], [-3, 3], (value) => (this.v[k] = value));
  }
}

const exact = (kind) => {
  const t = Array.from({ length: 721 }, (_, k) => (k / 720) * 2 * Math.PI);
  const path = [t, t.map((s) => 1.6 * s), t.map((s) => 1.6 * Math.sin(s)), t.map((s) => 1.6 * (kind === "disk" ? 1 - Math.cos(s) : -Math.cos(s)))];
  return kind === "disk" ? { coordinates: ["phi", "theta", "x", "y"], angles: ["phi"], tracks: [{ t, q: path }], picture: "disk" }
    : { coordinates: ["phi", "x", "y"], angles: ["phi"], tracks: [{ t, q: [path[0], path[2], path[3]] }], picture: kind };
};

// A picture of what a figure carries; null where its formulas are beyond this script.
export function moving(figure, { told = null, ...options } = {}) {
  const data = figure.querySelector("script[type='application/json']");
  try {
    return new Motion(figure, told ?? (data ? JSON.parse(data.textContent) : exact(figure.dataset.motion)), options);
  } catch (error) {
    figure.querySelector("[data-said]")?.append(`${error.message}.`);
    return null;
  }
}

for (const figure of document.querySelectorAll("[data-motion]")) moving(figure);
