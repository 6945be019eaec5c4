// The moving picture of an answer: the track of a motion, its clock, sliders, and a start to drag. How it is drawn is
// in pictures.js.

import { NAME, PICTURES, Frame, boxOf, escaped, fixed, line, picturesFor, placed, short } from "./pictures.js";
import { System, compiled, run } from "./system.js";

export { PICTURES };
export const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
const STEP = 0.02; // of the drawn curve, classical Runge-Kutta in two parts
const STEPS = 1500; // of a phase portrait; a path has half of them
const FAR = 6; // of a coordinate, or twice its start: the path beyond is not drawn
const NEAR = 3; // the same for a picture of cases, from the middle of the places where they meet
const REACH = 20; // of a coordinate, within which such places are looked for
const FAST = 3; // times the speed that is passed in a fifth of the time: of what falls into a pole no more is drawn
const [SLOW, HOLDS] = [1e-9, 1e-4]; // a speed, and the forces on both sides of rest that hold a point
const MEETS = 150; // steps of a motion, which it counts more for each further case that it passes
const SPEED = 1.4; // of the motion's time in s
const ZEROS = [0, 1, 0.5, -1]; // times at which a motion may begin
const RATES = [0.3, 5]; // in 1/s: of a motion that is as fast as that STEP is taken
const ROUNDED = 1e-9; // a smaller change of f, in parts of it, is that of its rounding
const DIALS = 3; // in a row
const MOST_DIALS = 6;
const TINY = 200; // CSS pixels: below that there is no room for words
const SHAPE = 384 / 408; // of a picture, height to width
// Positions and velocities of the first coordinates, the last of each for all others.
const STARTS = [[[1.5, 0.5, 0.2], [0.5, 0.8, 0.3]], [[0.1, 0], [1, 1, 0]], [[1, 0.5, 0.2], [0.1, 1, 0.3]], [[1, 0.3, 0.1], [0.2, 0.4, 0.1]],
  [[0.5, 0.2, 0.1], [0.1, 0.2, 0.3]], [[3, 1, 0.5], [0.1, 0.5, 0.2]], [[-1, -0.5, -0.2], [-0.1, -0.3, 0.2]], [[0.2, -0.3, 0.1], [-0.05, 0.1, 0.07]],
  [[1.2, 0.4, 0.2], [0.1, 0.2, 0.05]]];
const TRIED = 300; // steps for which a start is tried
const STAYS = 60; // of them, which a motion that stays in the room of its first half counts more
const ROOM = 1.25; // that room, made a little larger

const meter = (value) => !Number.isFinite(value) ? "no value here" : (Math.abs(value) < 1000 ? value.toFixed(4) : value.toPrecision(7)).replace(/^-(?=0\.0000$)/, "").replace("-", "\u2212");

// A time with as many digits as each of its motion has, so that what is beside it stays; "1.2e−5" for one that ends early.
export function timed(now, end) {
  const size = Math.floor(Math.log10(Math.abs(end) || 1));
  return (size < -2 ? `${(now / 10 ** size).toFixed(1)}e${size}` : now.toFixed(end < 3 ? 1 - Math.min(0, size) : 1)).replace(/-/g, "\u2212");
}

// One clock for all pictures of the page; one that is out of sight rests.
const moves = new Set();
const sights = new IntersectionObserver((seen) => { for (const one of seen) one.target.inSight = one.isIntersecting; }, { rootMargin: "80px" });
let [ticking, before] = [false, 0];
function tick(time) {
  const passed = Math.min(0.05, Math.max(0, (time - before) / 1000));
  before = time;
  for (const motion of moves) {
    if (!motion.svg.isConnected) moves.delete(motion);
    else if (motion.svg.inSight) motion.tick(passed);
  }
  ticking = moves.size > 0;
  if (ticking) requestAnimationFrame(tick);
}

// What moves is drawn by new values of attributes where its elements stay the same: new elements have the style of the whole
// page computed again.
const sketch = document.createElementNS("http://www.w3.org/2000/svg", "g");
function redraw(place, text) {
  sketch.innerHTML = text;
  const [old, now] = [place, sketch].map((one) => [...one.querySelectorAll("*")]);
  const isAlike = (one, other) => one.localName === other.localName && one.textContent === other.textContent && one.attributes.length === other.attributes.length && [...other.attributes].every(({ name }) => one.hasAttribute(name));
  const isSame = old.length === now.length && old.every((one, k) => isAlike(one, now[k]));
  if (!isSame) place.innerHTML = text;
  else now.forEach((one, k) => { for (const { name, value } of one.attributes) if (old[k].getAttribute(name) !== value) old[k].setAttribute(name, value); });
}
function write(place, text) {
  const node = place.firstChild;
  if (node?.nodeType !== Node.TEXT_NODE) place.textContent = text;
  else if (node.data !== text) node.data = text;
}

// What is drawn once, and moved after that.
const LAYERS = '<g data-under></g><g data-near></g><path class="beside" data-beside></path><path class="future" data-all></path><path class="past" data-done></path><g data-body></g><g class="hand" data-hand tabindex="0" role="slider" aria-label="Start. Arrow keys move it." aria-valuemin="-100" aria-valuemax="100" aria-valuenow="0"><circle r="22" class="reach"/><circle r="7.5" class="ring"/></g><g data-labels></g>';

export class Motion {
  // `told`: coordinates, labels, equations, constraints, values, angles, the picture and the other data that the
  // service sends; those of `other` move besides, from the same start. `tracks` of a computed motion [{t, q}] take the place of the equations; `small` leaves out dials
  // and handle.
  constructor(figure, told, { small = false, changed = null } = {}) {
    Object.assign(this, { figure, told, small, changed, place: 0, hold: 0 });
    this.svg = figure.querySelector("svg");
    this.n = told.coordinates.length;
    this.names = picturesFor(told.coordinates, told.angles, told.picture);
    this.name = this.names[0];
    this.middle = Array(this.n).fill(0); // of the picture
    this.svg.innerHTML = LAYERS;
    this.part = Object.fromEntries(["under", "near", "beside", "all", "done", "body", "hand", "labels"].map((key) => [key, this.svg.querySelector(`[data-${key}]`)]));
    this.button = figure.querySelector("[data-play]");
    this.now = figure.querySelector("[data-now]");
    this.said = figure.querySelector("[data-said]");
    if (told.equations) {
      this.system = new System(told);
      if (told.other) this.other = new System({ ...told, equations: told.other, constraints: [] });
      this.values = { ...told.values };
      this.guessValues();
      this.meters = [...figure.querySelectorAll("[data-meter]")].map((place, k) => [place, compiled(told.meters[k], this.system.slots)]);
    }
    if (told.tracks) {
      for (const track of told.tracks) track.v ??= track.q.map((q) => q.map((_, k) => { const [a, b] = [Math.max(0, k - 1), Math.min(q.length - 1, k + 1)]; return (q[b] - q[a]) / (track.t[b] - track.t[a]); }));
    } else {
      if (told.picture === "cases") this.meet();
      this.begin();
      if (!small) { this.handle(); this.dials(); }
    }
    if (told.tracks || small) this.part.hand.remove();
    this.update(true);
    const font = `${NAME} Formulas`; // labels are placed by their size in it
    if (!document.fonts.check(font)) document.fonts.load(font).then(() => { if (this.scene) this.show(); }, () => {});
    sights.observe(this.svg);
    this.sizes = new ResizeObserver(() => { if (this.svg.clientWidth && this.svg.clientWidth !== this.width) this.update(true, this.place); });
    this.sizes.observe(this.svg);
    this.button?.addEventListener("click", () => this.play(!this.playing));
    this.play(!calm());
  }

  get isPhase() { return this.n === 1; }

  get isTiny() { return this.width < TINY; }

  // A tree, or trees, that the picture knows as functions of q, v and the time.
  known(name) {
    const made = (one) => {
      if (one.list) return one.list.map(made);
      if (typeof one === "object" && !Array.isArray(one)) return Object.fromEntries(Object.entries(one).map(([key, part]) => [key, key === "label" ? part : made(part)]));
      const tree = compiled(one, this.system.slots);
      return (q, v, t = 0) => { const state = this.system.state(q, v, this.values); state[2 * this.n] = t; return tree(state); };
    };
    return made(this.told.known[name]);
  }

  // Damping is small by default: f depends on v through it alone. A mass that f divides by is not let go to zero.
  guessValues() {
    const { system } = this;
    this.ranges = {};
    const spread = (values, v = 0.4) => {
      const state = system.state(Array(this.n).fill(0.7), Array(this.n).fill(v), values);
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
      const damps = !isSingular && !system.w.length && spread(all) < -1e-9 && spread(all, -0.4) < -1e-9 && Math.abs(spread(none)) < 1e-9;
      if (damps && this.told.given?.[name] === undefined) this.values[name] = 0.35;
      this.ranges[name] = [isSingular ? 0.2 : Math.min(0, 2 * this.values[name]), Math.max(3, Math.ceil(2 * this.values[name])), damps ? "damping " : ""];
    }
  }

  begin() {
    const free = this.told.free ?? this.told.coordinates;
    const round = this.round();
    const candidates = round && !this.told.known.pairs ? [round] : this.told.start ? [[this.told.start.positions, this.told.start.velocities]] : STARTS.map(([q, v]) => [this.told.coordinates.map((_, k) => q[Math.min(k, q.length - 1)]),
      this.told.coordinates.map((name) => { const k = free.indexOf(name); return k < 0 ? NaN : v[Math.min(k, v.length - 1)]; })]);
    if (round && this.told.known.pairs) candidates.unshift(round);
    if (this.told.picture === "cases" && !this.told.start) for (const [q] of candidates) this.middle.forEach((x, k) => (q[k] += x));
    let best = -1;
    const thrown = this.told.start ? null : this.thrown();
    if (thrown) candidates.splice(0, candidates.length, thrown, ...candidates.slice(0, 1));
    // Where nothing moves from t = 0 on, the picture begins later.
    for (this.zero of ZEROS) {
      for (const [q, v] of candidates) {
        if (best < 0) [best, this.q, this.v] = [0, q, v];
        const lasted = this.lasts(q, v);
        if (lasted > best + 20) [best, this.q, this.v] = [lasted, q, v];
      }
      if (best > 0) break;
    }
    this.q = [...this.q];
    this.v = [...this.v];
  }

  // The sides of the cases, and for each coordinate the middle of the places where they change their sign.
  meet() {
    this.cases = this.known("cases").map(({ sides }) => sides);
    const [rest, v] = [Array(this.n).fill(0), Array(this.n).fill(0.5)];
    rest.forEach((_, k) => {
      const at = (side, x) => side(rest.map((q, j) => (j === k ? x : q)), v);
      const places = [];
      for (const side of this.cases.flat()) for (let x = -REACH; x < REACH; x += 0.25) {
        if (at(side, x) <= 0 === at(side, x + 0.25) <= 0) continue;
        let [low, high] = [x, x + 0.25];
        for (let n = 0; n < 30; n += 1) { const half = (low + high) / 2; if (at(side, half) <= 0 === at(side, low) <= 0) low = half; else high = half; }
        if (!places.some((one) => Math.abs(one - low) < 1e-6)) places.push(low);
      }
      if (places.length) this.middle[k] = Number(((Math.min(...places) + Math.max(...places)) / 2).toFixed(6));
    });
  }

  // In a force that is the same everywhere a body is thrown: up by 2, and to the side.
  thrown() {
    const { n, system } = this;
    const [rest, shown] = [Array(n).fill(0), JSON.stringify([this.told.equations, this.told.domain ?? []])];
    if (system.w.length || [...this.told.coordinates, this.told.time ?? "t"].some((name) => shown.includes(`"${name}"`))) return null;
    const force = system.f.map((f) => f(system.state(rest, rest, this.values)));
    const size = Math.hypot(...force);
    if (!(size > 0 && Number.isFinite(size))) return null;
    const speed = force.map((f) => (Math.abs(f) > 1e-9 * size ? (-2 * f) / Math.sqrt(size) : 1.6 * Math.sqrt(size)));
    const later = this.system.f.map((f) => f(system.state(rest, speed, this.values)));
    return force.reduce((sum, f, k) => sum + f * later[k], 0) > 0 ? [rest, speed] : null;
  }

  // A start that suits the picture: points on a circle, one about a center at distance 1, with 0.85 of the speed on a circle if it is drawn there;
  // on a sphere away from the poles, and a top turns fast.
  round() {
    const { told, n } = this;
    if (told.start || !told.known) return null;
    const { polar, swept, form, places, angles, equator, heading, rolled } = told.known;
    const [q, v] = [Array(n).fill(0), Array(n).fill(0)];
    if (told.picture === "disk") { // it turns a few times on its way around
      v.fill(NaN);
      [v[heading], v[rolled]] = [0.5, 2];
      return told.coordinates.every((name, k) => Number.isNaN(v[k]) === !(told.free ?? []).includes(name)) ? [q, v] : null;
    }
    if (told.picture === "points") { // on a circle, around which they move
      const { list: pairs } = told.known.pairs;
      pairs.forEach(({ list: [x, y] }, k) => {
        const angle = 0.4 + (2 * Math.PI * k) / pairs.length;
        [q[x], q[y], v[x], v[y]] = [Math.cos(angle), Math.sin(angle), -0.4 * Math.sin(angle), 0.4 * Math.cos(angle)].map((value) => Number(value.toFixed(2)));
      });
      return [q, v];
    }
    if (told.picture === "sphere") {
      const [tilt, turn] = angles.list;
      v.fill(4);
      [q[tilt], v[tilt], v[turn]] = [equator ? 0.5 : 1.1, 0.3, n > 2 ? 0.2 : 0.9];
      return [q, v];
    }
    const [r, tilt, turn] = form ? places.list : [...(told.known.round?.list ?? [0, 1]), 1];
    if (!(form || (told.picture === "central" && (polar || swept)))) return null;
    if (form === "pole") q[tilt] = 1.1;
    if (form === "cylinder") q[turn] = 0.4;
    const pull = (far) => { q[r] = far; return -this.system.f[r](this.system.state(q, v, this.values)); };
    const far = [1, 2, 3].find((one) => pull(one) > 0); // nearer it may be driven away
    if (!far) return null;
    const turns = Math.sqrt(pull(far) / far);
    v[form && form !== "cylinder" ? turn : tilt] = Number((0.85 * turns).toPrecision(6));
    if (form) v[form === "cylinder" ? turn : tilt] = -0.3 * turns * (form === "cylinder" ? far : 1);
    return [q, v];
  }

  // The step: STEP, or in proportion for a motion that is much faster or slower, by the slopes of f at the start, or where
  // these say slow, on the way from there.
  get step() {
    if (this.told.span) return STEP;
    const state = this.from(this.q, this.v);
    let rate = this.rate(state);
    if (rate < RATES[0]) {
      let count = 0;
      run(this.system, state, 2 * STEP, 200, 1, (now) => { if ((count += 1) % 20 === 0) rate = Math.max(rate, this.rate(now)); });
    }
    return rate > RATES[1] ? (STEP * RATES[1]) / rate : rate > 0 && rate < RATES[0] ? (STEP * RATES[0]) / rate : STEP;
  }

  // How fast a motion is at a state, in 1/s, by the slopes of f.
  rate(state) {
    const { system } = this;
    let rate = 0;
    for (let k = 0; k < 2 * this.n; k += 1) {
      const [before, d] = [system.f.map((f) => f(state)), 1e-4 * Math.max(1, Math.abs(state[k]))];
      state[k] += d;
      const changed = system.f.map((f, i) => { const by = Math.abs(f(state) - before[i]); return by > ROUNDED * Math.abs(before[i]) ? by : 0; });
      const slope = Math.max(...changed) / d;
      state[k] -= d;
      if (Number.isFinite(slope)) rate = Math.max(rate, k < this.n ? Math.sqrt(slope) : slope);
    }
    return rate;
  }

  // The state at the start: velocities that are left open follow from the constraints.
  from(q, v) {
    const state = this.system.state(q, this.system.completed(q, v, this.values), this.values);
    state[2 * this.n] = this.zero;
    return state;
  }

  far(q) { return Math.max(this.cases ? NEAR : FAR, ...q.map((x, k) => 2 * this.away(x, k))); }

  away(x, k) { return Math.abs(x - this.middle[k]); }

  // Whether a coordinate turns: it may grow without end, and the point stays where it is drawn.
  turns(k) {
    const { angles, coordinates, picture, known } = this.told;
    const [, second, third] = known?.places?.list ?? [];
    return angles.includes(coordinates[k]) || picture === "sphere" || (known?.polar && k === (known.round?.list[1] ?? 1)) || k === second || (k === third && known.form !== "cylinder");
  }

  // For how many steps a motion stays near and on its side of what the answer needs; STAYS more for one whose places, of
  // coordinates on which the forces depend, do not leave the room of its first half.
  lasts(q, v) {
    const start = this.from(q, v);
    const sides = this.system.sides.map((side) => side(start));
    if (this.told.signs?.some((sign, k) => (sign ? !(sides[k] > 0) : !sides[k]))) return 0;
    const shown = JSON.stringify(this.told.equations);
    const places = this.told.coordinates.map((_, k) => k).filter((k) => shown.includes(`"${this.told.coordinates[k]}"`) && !this.turns(k));
    const [room, all] = [places.map((k) => [start[k], start[k]]), places.map((k) => [start[k], start[k]])];
    let [lasted, count] = [0, 0];
    const passed = new Set();
    const far = this.far(q);
    run(this.system, start, 2.5 * this.step, TRIED, 1, (state) => {
      count += 1;
      if (this.system.sides.every((side, k) => side(state) * sides[k] > 0) && state.slice(0, this.n).every((x, k) => this.turns(k) || this.away(x, k) < far)) {
        lasted += 1;
        const here = this.cases ? this.cases.findIndex((sides) => sides.every((side) => side(state.slice(0, this.n), state.slice(this.n, 2 * this.n)) > 0)) : -1;
        if (here >= 0) passed.add(here);
      }
      places.forEach((k, i) => { for (const box of count <= TRIED / 2 ? [room[i], all[i]] : [all[i]]) { box[0] = Math.min(box[0], state[k]); box[1] = Math.max(box[1], state[k]); } });
    });
    const size = (box) => box[1] - box[0];
    const counts = this.told.picture !== "none"; // its lines are far apart where the motion is large
    return lasted + MEETS * Math.max(0, passed.size - 1) + (counts && lasted >= TRIED && all.every((box, i) => size(box) <= ROOM * size(room[i])) ? STAYS : 0);
  }

  track(q, v, steps = Math.round(Math.min(4000, this.told.span ? this.told.span / STEP : this.isPhase ? STEPS : STEPS / 2)), system = this.system) {
    const start = this.from(q, v);
    const found = run(system, start, this.step, steps, 2);
    let end = found.t.length;
    const far = this.far(q);
    const isFar = (k) => found.q.some((column, j) => this.away(column[k], j) > far && !this.turns(j));
    for (let k = 0; k < end; k += 1) if (isFar(k)) end = k;
    if (found.stopped !== undefined && this.isPhase && end) { // where it falls into a pole its last speeds leave no room for the others
      const speeds = found.v[0].slice(0, end).map(Math.abs);
      const usual = [...speeds].sort((a, b) => a - b)[Math.floor(0.8 * end)];
      const first = speeds.findIndex((v, k) => k > 0.8 * end && v > FAST * usual);
      if (first > 0) end = first;
    }
    if (this.isPhase && !this.told.span && end > 200) { // what has died out is not drawn
      const [top, fast] = [Math.max(...found.q[0].map(Math.abs)), Math.max(...found.v[0].map(Math.abs)) || 1];
      while (end > 200 && Math.hypot(found.q[0][end - 1] / top, found.v[0][end - 1] / fast) < 0.02) end -= 1;
    }
    const rests = this.isPhase && this.cases ? this.rests(found, end) : -1;
    if (rests >= 0) end = rests + 1;
    return { t: found.t.slice(0, end), q: found.q.map((c) => c.slice(0, end)), v: found.v.map((c) => c.slice(0, end)), stopped: rests < 0 ? found.stopped : undefined, rests: rests < 0 ? undefined : found.t[rests] };
  }

  // The step at which dry friction holds the point: on either side of v = 0 the force drives it back to it.
  rests({ q: [q], v: [v] }, end) {
    const force = (x, rate) => this.system.f[0](this.system.state([x], [rate], this.values));
    for (let k = 1; k < end; k += 1) {
      const [ahead, back] = [force(q[k], SLOW), force(q[k], -SLOW)];
      if (v[k - 1] * v[k] <= 0 && ahead < -HOLDS && back > HOLDS) return k;
    }
    return -1;
  }

  // The motion from another start at the times of this one, also where it is far.
  flow(q, v) { return run(this.system, this.from(q, v), this.step, this.main.t.length - 1, 2); }

  // A frame for points of the picture; while something is dragged it only grows.
  frame(area, box, options = {}) {
    if (this.beyond) box = boxOf(this.beyond, [...box]);
    if (!this.settled && this.box) box = boxOf([[this.box[0], this.box[2]], [this.box[1], this.box[3]]], [...box]);
    this.box = box;
    return new Frame(area, box, options);
  }

  // After a slider or the start was moved; `settled` fits the frame to the present path.
  update(settled, place = 0) {
    this.settled = settled;
    this.width = this.svg.clientWidth || 408;
    this.height = this.svg.clientHeight || this.width * SHAPE;
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    this.main = this.told.tracks?.[0] ?? this.track(this.q, this.v);
    this.svg.classList.toggle("blank", this.main.t.length < 2);
    if (this.main.t.length < 2) { this.say("There is no motion from this start."); return; }
    const { stopped, rests } = this.main;
    this.say(stopped !== undefined ? `no value from t = ${short(stopped)} on` : rests !== undefined ? `at rest from t = ${short(rests)} on` : this.told.tracks ? "" : "by Runge\u2013Kutta");
    try {
      this.make();
    } catch (error) {
      // What the picture needs has no value here: the plainer one, of which the caption says nothing.
      for (const caption of this.figure.querySelectorAll("figcaption")) caption.hidden = true;
      [this.name] = this.names.filter((name) => name !== this.name && PICTURES[name].fits);
      this.make();
    }
    this.screen = this.scene.points.map((at) => this.scene.frame.at(at));
    this.show();
    this.place = Math.min(place, this.main.t.at(-1) - this.main.t[0]);
    this.hold = 0;
    this.draw();
  }

  make() {
    const make = PICTURES[this.name].make;
    this.beyond = null;
    if (this.other) {
      this.beside = this.track(this.q, this.v, undefined, this.other);
      const alone = Object.create(this, { main: { value: this.beside }, isTiny: { value: true }, frame: { value: (...what) => new Frame(...what) } });
      const scene = make(alone);
      if (!scene.isPathless) this.beyond = scene.points.filter(([x, y]) => Number.isFinite(x + y));
    }
    this.scene = make(this);
    this.shadow = this.beyond?.map((at) => this.scene.frame.at(at));
  }

  say(text) { if (this.said) this.said.textContent = text; }

  // The case of the page that holds at the point.
  holds(k) { for (const place of document.querySelectorAll("[data-case]")) place.classList.toggle("now", place.dataset.case === String(k)); for (const text of this.svg.querySelectorAll("[data-here]")) text.classList.toggle("now", text.dataset.here === String(k)); }

  show() {
    const { part, scene, screen } = this;
    part.under.innerHTML = scene.under;
    part.near.innerHTML = scene.near ?? "";
    const curve = scene.isPathless ? "" : line(screen);
    part.all.setAttribute("d", curve);
    part.beside.setAttribute("d", this.shadow ? line(this.shadow) : "");
    part.done.setAttribute("d", curve);
    this.lengths = [0];
    for (let k = 1; k < screen.length; k += 1) this.lengths.push(this.lengths[k - 1] + (Math.hypot(screen[k][0] - screen[k - 1][0], screen[k][1] - screen[k - 1][1]) || 0));
    const labels = [...scene.labels];
    const taken = [...(scene.taken ?? [])];
    const isHeld = part.hand.isConnected && Boolean(scene.put);
    part.hand.classList.toggle("hidden", !isHeld);
    if (isHeld) {
      const [u, v] = screen[0];
      taken.push([u - 10, v - 10, u + 10, v + 10]);
      part.hand.setAttribute("transform", `translate(${fixed(u)} ${fixed(v)})`);
      const ahead = screen.slice(1, 2 + screen.length / 12).reduce((sum, at) => sum + at[1] - v, 0);
      const [near, far] = ahead > 0 ? [-13, 25] : [25, -13];
      if (!this.isMoved && !this.isTiny) labels.push({ words: "drag the start", name: "drag", spare: true, at: [...[near, far, 5, 1.7 * near, 1.7 * far, 2.4 * near, 2.4 * far].flatMap((by) => [[u + 14, v + by, "start"], [u - 14, v + by, "end"], [u, v + by]]), ...[this.height - 8, 18].flatMap((w) => [[this.width - 8, w, "end"], [8, w, "start"]])] }); // else in a corner
      const told = this.told.coordinates.map((name, k) => `${this.called(name)} ${short(this.q[k])}`).join(", ");
      part.hand.setAttribute("aria-valuetext", told);
      const [left, , right] = scene.frame.area;
      part.hand.setAttribute("aria-valuenow", Math.round(100 * ((u - left) / (right - left) - 0.5)));
    }
    const style = getComputedStyle(this.svg);
    const fonts = { family: style.fontFamily, math: style.getPropertyValue("--math") };
    part.labels.innerHTML = placed(labels, { width: this.width, height: this.height, ...fonts, taken, curves: [...(scene.isPathless ? [] : [screen]), ...(scene.curves ?? [])], lines: scene.frame.lines });
  }

  called(name) { return this.told.labels?.[name] ?? name; }

  draw() {
    const last = this.screen.length - 1;
    const k = Math.min(last, Math.round(this.place / (this.main.t[1] - this.main.t[0])));
    this.part.done.setAttribute("stroke-dasharray", `${fixed(this.lengths[k])} 99999`);
    const other = this.shadow?.[Math.min(k, this.shadow.length - 1)];
    redraw(this.part.body, (other ? `<circle class="beside" cx="${fixed(other[0])}" cy="${fixed(other[1])}" r="5"/>` : "") + this.scene.draw(k));
    if (this.now) write(this.now, `t = ${timed(this.main.t[k], this.main.t.at(-1))}`);
    if (!this.meters?.length || this.told.tracks) return;
    const states = [this.main, ...(this.beside ? [this.beside] : [])].map((track) => {
      const now = Math.min(k, track.t.length - 1);
      const state = this.system.state(track.q.map((column) => column[now]), track.v.map((column) => column[now]), this.values);
      state[2 * this.n] = track.t[now];
      return state;
    });
    // Beside another system the second meter is the same quantity of that.
    this.meters.forEach(([place, value], j) => write(place, meter(value(states[Math.min(j, states.length - 1)]))));
  }

  play(on) {
    this.playing = on;
    if (this.button) this.button.textContent = on ? "Pause" : "Play";
    if (!on) { moves.delete(this); return; }
    moves.add(this);
    if (ticking) return;
    ticking = true;
    before = performance.now();
    requestAnimationFrame(tick);
  }

  tick(passed) {
    const end = this.main.t.at(-1) - this.main.t[0];
    if (!(this.main.t.length > 1)) return;
    const pace = (SPEED * (this.main.t[1] - this.main.t[0])) / STEP;
    if (this.place < end) this.place += passed * (this.told.tracks ? Math.max(SPEED, end / 24) : Math.max(pace, end / 24));
    else if ((this.hold += passed) > 1.2) { this.place = 0; this.hold = 0; }
    this.draw();
  }

  // The start, dragged or moved by keys.
  handle() {
    const { hand } = this.part;
    const put = (at, settled) => {
      this.scene.put(this.scene.frame.back(at));
      this.isMoved = true;
      this.update(settled);
      this.changed?.();
    };
    const from = (event) => { const box = this.svg.getBoundingClientRect(); return [((event.clientX - box.left) * this.width) / box.width, ((event.clientY - box.top) * this.height) / box.height]; };
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
    const add = (word, name, value, [low, high], moved) => {
      const label = word + name;
      const dial = document.createElement("label");
      dial.className = "slide";
      dial.innerHTML = `<span><span class="what"><i>${escaped(word)}</i>${escaped(name)}</span><output></output></span><input type="range" min="${low}" max="${high}" step="0.05">`;
      const [slider, output] = [dial.querySelector("input"), dial.querySelector("output")];
      const show = () => (output.textContent = short(Number(slider.value)));
      slider.setAttribute("aria-label", label); // a label with an output in it names that
      slider.value = value;
      show();
      slider.addEventListener("input", (event) => { event.stopPropagation(); show(); moved(Number(slider.value)); this.update(false); this.changed?.(); });
      slider.addEventListener("change", () => this.update(true));
      place.append(dial);
    };
    const parameters = Object.keys(this.values).slice(0, MOST_DIALS);
    for (const name of parameters) add(this.ranges[name][2], this.called(name), this.values[name], this.ranges[name], (value) => (this.values[name] = value));
    if (this.isPhase) return;
    // The velocities at the start: all that are free, or none.
    const free = this.told.coordinates.map((_, k) => k).filter((k) => !Number.isNaN(this.v[k]));
    if (parameters.length + free.length > MOST_DIALS) return;
    for (const k of free) add("start ", `${this.called(this.told.coordinates[k])}\u2032`, this.v[k], [-1, 1].map((sign) => sign * Math.max(3, Math.ceil(1.5 * Math.abs(this.v[k])))), (value) => (this.v[k] = value));
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
    const known = told ?? (data ? JSON.parse(data.textContent) : exact(figure.dataset.motion));
    const first = document.querySelector(".hero [data-motion]")?.motion;
    if (known.picture === "agreement" && first) known.start = { positions: first.q, velocities: first.v };
    figure.motion = new Motion(figure, known, options);
    return figure.motion;
  } catch (error) {
    figure.querySelector("[data-said]")?.append(`${error.message}.`);
    return null;
  }
}

for (const figure of document.querySelectorAll("[data-motion]")) moving(figure);
