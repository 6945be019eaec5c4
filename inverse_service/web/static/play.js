// A motion to play with: the formulas that the service sends are interpreted here, never evaluated as text.

import { LOOKS, Stage, calm, choices, color, picturesFor, player, PICTURES } from "./motion.js";

const MOST_STEPS = 4000; // recorded points of a preview
const SMALL = 0.01; // step of the reference
const SECTION_TIME = 400;
const REDRAW_PAUSE = 250; // ms after which changed functions are asked for

const FUNCTIONS = {
  ...Object.fromEntries(["exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"].map((name) => [name, Math[name]])),
  cot: (u) => 1 / Math.tan(u), sec: (u) => 1 / Math.cos(u), csc: (u) => 1 / Math.sin(u),
  coth: (u) => 1 / Math.tanh(u), sech: (u) => 1 / Math.cosh(u), csch: (u) => 1 / Math.sinh(u),
};

// A tree to a function of the state, which holds coordinates, velocities, the time and the parameters in `slots`.
export function compiled(tree, slots) {
  if (typeof tree === "number") return () => tree;
  if (typeof tree === "string") {
    if (tree === "pi") return () => Math.PI;
    const place = slots.get(tree);
    if (place === undefined) throw new Error(`${tree} has no value`);
    return (state) => state[place];
  }
  const parts = tree.slice(1).map((part) => compiled(part, slots));
  const [a, b] = parts;
  switch (tree[0]) {
    case "+": return parts.length === 2 ? (s) => a(s) + b(s) : (s) => { let sum = 0; for (const part of parts) sum += part(s); return sum; };
    case "*": return parts.length === 2 ? (s) => a(s) * b(s) : (s) => { let found = 1; for (const part of parts) found *= part(s); return found; };
    case "^": return tree[2] === 2 ? (s) => { const v = a(s); return v * v; } : tree[2] === -1 ? (s) => 1 / a(s) : (s) => a(s) ** b(s);
    default: {
      const f = FUNCTIONS[tree[0]];
      if (!f) throw new Error(`${tree[0]} is not known here`);
      return (s) => f(a(s));
    }
  }
}

// The system of a form: accelerations and constraints as functions of one state.
export class System {
  constructor(told) {
    this.coordinates = told.coordinates;
    this.n = told.coordinates.length;
    const names = [...told.coordinates, ...told.coordinates.map((name) => `${name}'`), "t", ...Object.keys(told.values)];
    this.slots = new Map(names.map((name, k) => [name, k]));
    this.size = names.length;
    this.f = told.equations.map((tree) => compiled(tree, this.slots));
    this.w = told.constraints.map((tree) => compiled(tree, this.slots));
  }

  state(positions, velocities, values) {
    const found = new Float64Array(this.size);
    found.set(positions);
    found.set(velocities, this.n);
    for (const [name, value] of Object.entries(values)) if (this.slots.has(name)) found[this.slots.get(name)] = value;
    return found;
  }

  // Velocities that are left open (NaN) follow from the constraints, which are linear in them; else they are zero.
  completed(positions, velocities, values) {
    const open = velocities.map((v, k) => (Number.isNaN(v) ? k : -1)).filter((k) => k >= 0);
    const known = velocities.map((v) => (Number.isNaN(v) ? 0 : v));
    if (!open.length || open.length !== this.w.length) return known;
    const state = this.state(positions, known, values);
    const rest = this.w.map((w) => w(state));
    const rows = this.w.map((w, i) => [...open.map((k) => { state[this.n + k] += 1; const slope = w(state) - rest[i]; state[this.n + k] -= 1; return slope; }), -rest[i]]);
    const solved = solve(rows);
    open.forEach((k, i) => (known[k] = solved[i]));
    return known;
  }

  rate(state, into) {
    for (let k = 0; k < this.n; k += 1) { into[k] = state[this.n + k]; into[this.n + k] = this.f[k](state); }
  }
}

function solve(rows) {
  const n = rows.length;
  for (let k = 0; k < n; k += 1) {
    const best = rows.slice(k).reduce((at, row, i) => (Math.abs(row[k]) > Math.abs(rows[at][k]) ? k + i : at), k);
    [rows[k], rows[best]] = [rows[best], rows[k]];
    for (let i = 0; i < n; i += 1) if (i !== k) {
      const factor = rows[i][k] / rows[k][k];
      for (let j = k; j <= n; j += 1) rows[i][j] -= factor * rows[k][j];
    }
  }
  return rows.map((row, k) => row[n] / row[k]);
}

const STEPS = {
  euler(system, state, h, work) {
    const [a] = work;
    system.rate(state, a);
    for (let k = 0; k < 2 * system.n; k += 1) state[k] += h * a[k];
  },
  symplectic(system, state, h, work) {
    const [a] = work;
    system.rate(state, a);
    for (let k = 0; k < system.n; k += 1) state[system.n + k] += h * a[system.n + k];
    for (let k = 0; k < system.n; k += 1) state[k] += h * state[system.n + k];
  },
  runge(system, state, h, work) {
    const [a, b, c, d, mid] = work;
    const m = 2 * system.n;
    const t = m;
    mid.set(state);
    system.rate(state, a);
    for (let k = 0; k < m; k += 1) mid[k] = state[k] + (h / 2) * a[k];
    mid[t] = state[t] + h / 2;
    system.rate(mid, b);
    for (let k = 0; k < m; k += 1) mid[k] = state[k] + (h / 2) * b[k];
    system.rate(mid, c);
    for (let k = 0; k < m; k += 1) mid[k] = state[k] + h * c[k];
    mid[t] = state[t] + h;
    system.rate(mid, d);
    for (let k = 0; k < m; k += 1) state[k] += (h / 6) * (a[k] + 2 * b[k] + 2 * c[k] + d[k]);
  },
};

// The columns {t, q, v} of `steps` steps h, each made of `parts` steps of a method; ends where a number is not finite.
export function run(system, start, h, steps, method, parts = 1, each = null) {
  const state = Float64Array.from(start);
  const work = Array.from({ length: 5 }, () => new Float64Array(system.size));
  const found = { t: [], q: system.coordinates.map(() => []), v: system.coordinates.map(() => []) };
  const zero = state[2 * system.n];
  for (let step = 0; step <= steps; step += 1) {
    if (step) for (let part = 0; part < parts; part += 1) {
      STEPS[method](system, state, h / parts, work);
      state[2 * system.n] = zero + (step - 1) * h + ((part + 1) * h) / parts;
      each?.(state);
    }
    if (!state.every(Number.isFinite)) return { ...found, stopped: zero + step * h };
    if (each) continue;
    found.t.push(state[2 * system.n]);
    for (let k = 0; k < system.n; k += 1) { found.q[k].push(state[k]); found.v[k].push(state[system.n + k]); }
  }
  return found;
}

// Where coordinate `c` rises through zero: the points (q, v) of coordinate `d`.
export function section(system, start, c, d) {
  const x = [];
  const y = [];
  const before = Float64Array.from(start);
  run(system, start, SMALL, SECTION_TIME / SMALL, "runge", 1, (state) => {
    if (before[c] < 0 && state[c] >= 0) {
      const part = before[c] / (before[c] - state[c]);
      x.push(before[d] + part * (state[d] - before[d]));
      y.push(before[system.n + d] + part * (state[system.n + d] - before[system.n + d]));
    }
    before.set(state);
  });
  return { x, y };
}

// Axes with round values, lines or dots; the range is kept for who drags on it.
export function chart(canvas, { lines, x, y, dots = false, log_x = false, log_y = false, equal = false, start = true }) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientWidth * 0.66];
  if (!width) return null;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const span = (values, isLogarithmic) => {
    let [low, high] = [Infinity, -Infinity];
    for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(high >= low)) [low, high] = [-1, 1];
    if (isLogarithmic && high < low + 2) [low, high] = [Math.floor(low) - 1, Math.ceil(high)]; // decades to read it by
    const margin = 0.06 * (high - low) || 0.5 * Math.max(Math.abs(low), 1);
    return [low - margin, high + margin];
  };
  const scaled = (values, isLogarithmic) => values.map((v) => (v === null ? NaN : isLogarithmic ? (v > 0 ? Math.log10(v) : NaN) : v));
  lines = lines.map((line) => ({ ...line, x: scaled(line.x, log_x), y: scaled(line.y, log_y) }));
  const across = span(lines.flatMap((line) => line.x), log_x);
  const up = span(lines.flatMap((line) => line.y), log_y);
  const box = { left: 58, right: width - 10, top: 8, bottom: height - 40 };
  if (equal) {
    const unit = Math.max((across[1] - across[0]) / (box.right - box.left), (up[1] - up[0]) / (box.bottom - box.top));
    for (const [range, size] of [[across, box.right - box.left], [up, box.bottom - box.top]]) {
      const middle = (range[0] + range[1]) / 2;
      [range[0], range[1]] = [middle - (unit * size) / 2, middle + (unit * size) / 2];
    }
  }
  const X = (v) => box.left + ((v - across[0]) / (across[1] - across[0])) * (box.right - box.left);
  const Y = (v) => box.bottom - ((v - up[0]) / (up[1] - up[0])) * (box.bottom - box.top);
  pen.font = "13px sans-serif";
  for (const [range, place, isX] of [[across, X, true], [up, Y, false]]) {
    const raw = (range[1] - range[0]) / 5;
    const power = 10 ** Math.floor(Math.log10(raw));
    const isLogarithmic = isX ? log_x : log_y;
    const step = isLogarithmic ? Math.max(1, Math.ceil(raw)) : [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
    for (let k = Math.ceil(range[0] / step); k * step <= range[1]; k += 1) {
      const at = place(k * step);
      pen.strokeStyle = color("--line");
      pen.beginPath();
      if (isX) { pen.moveTo(at, box.top); pen.lineTo(at, box.bottom); } else { pen.moveTo(box.left, at); pen.lineTo(box.right, at); }
      pen.stroke();
      pen.fillStyle = color("--soft");
      pen.textAlign = isX ? "center" : "right";
      const text = isLogarithmic ? `1e${k * step}` : String(Number((k * step).toPrecision(6)));
      pen.fillText(text, isX ? at : box.left - 6, isX ? box.bottom + 16 : at + 4);
    }
  }
  pen.textAlign = "center";
  pen.fillText(x, (box.left + box.right) / 2, height - 6);
  pen.save();
  pen.translate(12, (box.top + box.bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(y, 0, 0);
  pen.restore();
  lines.forEach((line, k) => {
    const [name, dash] = LOOKS[k % LOOKS.length];
    pen.strokeStyle = pen.fillStyle = line.color ?? color(name);
    pen.globalAlpha = line.alpha ?? 1;
    if (dots || line.markers) {
      const size = Math.max(3, line.width ?? 0);
      pen.beginPath(); // filled at once: where points overlap a pale line stays pale
      line.x.forEach((v, i) => pen.rect(X(v) - size / 2, Y(line.y[i]) - size / 2, size, size));
      pen.fill();
      if (dots) return;
    }
    pen.lineWidth = line.width ?? (k ? 1.5 : 2);
    pen.setLineDash(line.dash ?? dash);
    pen.beginPath();
    let isDrawn = false;
    line.x.forEach((v, i) => {
      const w = line.y[i];
      if (Number.isFinite(v + w)) pen[isDrawn ? "lineTo" : "moveTo"](X(v), Y(w));
      isDrawn = Number.isFinite(v + w);
    });
    pen.stroke();
    pen.setLineDash([]);
  });
  pen.globalAlpha = 1;
  const begin = start && lines[0] && !dots && { x: X(lines[0].x[0]), y: Y(lines[0].y[0]) };
  if (begin) {
    pen.fillStyle = color("--ink");
    pen.beginPath();
    pen.arc(begin.x, begin.y, 4.5, 0, 2 * Math.PI);
    pen.fill();
  }
  return { value: (u, v) => [across[0] + ((u - box.left) / (box.right - box.left)) * (across[1] - across[0]), up[0] + ((box.bottom - v) / (box.bottom - box.top)) * (up[1] - up[0])] };
}

// "1/2", "0.1", "1e-3"; NaN for what is no number.
export function value(text) {
  const [top, below, ...more] = text.trim().split("/").map((part) => (part.trim() === "" ? NaN : Number(part)));
  return more.length ? NaN : below === undefined ? top : top / below;
}

const short = (number) => String(Number(number.toPrecision(4)));

class Play {
  constructor(form, panel) {
    this.form = form;
    this.panel = panel;
    this.part = Object.fromEntries(["stage", "chart", "kind", "coordinate", "compare", "picture", "said"].map((name) => [name, panel.querySelector(`[data-${name}]`)]));
    this.load();
    form.addEventListener("input", (event) => {
      if (event.target.name?.startsWith("function.")) { clearTimeout(this.timer); this.timer = setTimeout(() => this.load(), REDRAW_PAUSE); } else this.redraw();
    });
    for (const name of ["kind", "coordinate", "compare"]) this.part[name].addEventListener("change", () => this.redraw());
    this.part.picture.addEventListener("change", () => this.redraw());
    this.drag(this.part.stage, (x, y) => this.dragStage(x, y));
    this.drag(this.part.chart, (x, y) => this.dragChart(x, y));
    new ResizeObserver(() => this.drawChart()).observe(this.part.chart);
    document.addEventListener("colors", () => this.drawChart());
  }

  field(kind, name) { return this.form.elements.namedItem(`${kind}.${name}`); }

  // The name of a coordinate as its box shows it.
  called(name) { return this.field("position", name)?.labels[0]?.textContent ?? name; }

  async load() {
    const answer = await fetch(this.panel.dataset.preview, { method: "POST", body: new URLSearchParams(new FormData(this.form)) });
    const told = answer.ok ? await answer.json() : { reason: "The service does not answer at the moment." };
    if (told.reason !== undefined) { this.say(told.reason); return; }
    try {
      this.system = new System(told);
    } catch (error) { this.say(`${error.message}.`); return; }
    this.values = told.values;
    if (!this.stage) {
      choices(this.part.picture, picturesFor(told.coordinates, told.angles));
      this.part.coordinate.replaceChildren(...told.coordinates.map((name) => new Option(this.called(name), name)));
      this.part.coordinate.parentElement.hidden = told.coordinates.length < 2;
      if (told.coordinates.length < 2) this.part.kind.querySelector("[value=section]").remove();
      this.panel.hidden = false;
      this.sliders();
    }
    this.redraw();
    if (this.begun) return;
    this.begun = true;
    this.play = player(this.panel.querySelector(".motion"), (place) => { if (this.stage) { this.stage.place = place; this.stage.draw(); } });
    if (!calm()) this.play();
  }

  say(text) {
    this.panel.hidden = false;
    this.part.said.textContent = text;
  }

  // A slider under each number; it writes into its box, so that Run sends what is seen.
  sliders() {
    for (const box of this.form.querySelectorAll("[name^='parameter.'], [name^='position.'], [name^='velocity.']")) {
      const now = value(box.value);
      if (Number.isNaN(now)) continue; // follows from the constraints
      const slider = document.createElement("input");
      const reach = box.name.startsWith("parameter.") ? Math.max(2, 2 * Math.abs(now)) : Math.max(3, 2 * Math.abs(now));
      Object.assign(slider, { type: "range", min: short(box.name.startsWith("parameter.") && now >= 0 ? 0 : -reach), max: short(reach), step: short(reach / 200), value: now });
      slider.setAttribute("aria-label", `${box.labels[0]?.textContent ?? box.name}, slider`);
      slider.addEventListener("input", (event) => { event.stopPropagation(); box.value = short(Number(slider.value)); this.redraw(); });
      box.addEventListener("input", () => { const given = value(box.value); if (!Number.isNaN(given)) slider.value = given; });
      box.after(slider);
    }
  }

  read(kind, names) { return names.map((name) => value(this.field(kind, name)?.value ?? "")); }

  redraw() {
    if (!this.system) return;
    const { coordinates } = this.system;
    const values = { ...this.values };
    for (const name of Object.keys(values)) { const given = value(this.field("parameter", name)?.value ?? ""); if (!Number.isNaN(given)) values[name] = given; }
    const positions = this.read("position", coordinates).map((v) => (Number.isNaN(v) ? 0 : v));
    const velocities = this.system.completed(positions, this.read("velocity", coordinates), values);
    const h = value(this.form.elements.step.value);
    const steps = Math.min(MOST_STEPS, Math.round(Number(this.form.elements.steps.value)));
    if (!(h > 0) || !(steps > 0)) { this.say("The step must be greater than 0, the number of steps too."); return; }
    this.start = this.system.state(positions, velocities, values);
    const parts = Math.max(1, Math.ceil(h / SMALL));
    const tracks = [{ label: "small steps", ...run(this.system, this.start, h, steps, "runge", parts) }];
    const other = this.part.compare.value;
    if (other) tracks.push({ label: this.part.compare.selectedOptions[0].text, ...run(this.system, this.start, h, steps, other) });
    this.tracks = tracks;
    const stopped = tracks.find((track) => track.stopped !== undefined);
    this.part.said.textContent = stopped ? `${stopped.label}: no finite number from t = ${short(stopped.stopped)} on.` : "";
    if (!tracks[0].t.length) { this.say("The equations have no value at this start."); return; }
    if (this.stage) this.stage.show(coordinates, this.part.picture.value, tracks.filter((track) => track.t.length));
    else this.stage = new Stage(this.part.stage, { coordinates, picture: this.part.picture.value, tracks });
    this.drawChart();
  }

  drawChart() {
    if (!this.tracks) return;
    const { coordinates } = this.system;
    const c = Math.max(0, this.part.coordinate.selectedIndex);
    const [name, following] = [c, (c + 1) % coordinates.length].map((place) => this.called(coordinates[place]));
    const [first, second] = this.tracks;
    const kinds = {
      phase: () => ({ lines: this.tracks.map((track) => ({ x: track.q[c], y: track.v[c] })), x: name, y: `${name}\u2032` }),
      time: () => ({ lines: this.tracks.map((track) => ({ x: track.t, y: track.q[c] })), x: "t", y: name }),
      difference: () => ({ lines: second ? [{ x: second.t, y: second.t.map((_, k) => second.q[c][k] - first.q[c][k]) }] : [], x: "t", y: `${name}, method \u2212 small steps` }),
      section: () => {
        const d = (c + 1) % coordinates.length;
        return { lines: [section(this.system, this.start, c, d)], x: `${following} where ${name} rises through 0`, y: `${following}\u2032`, dots: true };
      },
    };
    const kind = this.part.kind.value;
    this.axes = chart(this.part.chart, kinds[kind]());
    this.part.chart.setAttribute("aria-label", `${this.part.kind.selectedOptions[0].text}: ${name}`);
    if (kind === "difference" && !second) this.part.said.textContent = "Choose a method to compare with.";
  }

  drag(canvas, moved) {
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); moved(event.offsetX, event.offsetY); });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) moved(event.offsetX, event.offsetY); });
  }

  write(kind, name, number) {
    const box = this.field(kind, name);
    box.value = short(number);
    box.dispatchEvent(new Event("input", { bubbles: true }));
  }

  dragChart(u, v) {
    if (this.part.kind.value !== "phase" || !this.axes) return;
    const name = this.system.coordinates[Math.max(0, this.part.coordinate.selectedIndex)];
    const [q, p] = this.axes.value(u, v);
    this.write("position", name, q);
    this.write("velocity", name, p);
  }

  dragStage(u, v) {
    const { coordinates } = this.system ?? {};
    if (!this.stage || this.stage.place > 0.999) return;
    const [x, y] = this.stage.toPlane([u, v]);
    const picture = PICTURES[this.part.picture.value];
    const q = this.read("position", coordinates);
    if (picture.drag) picture.drag(q, x, y).forEach((number, k) => this.write("position", coordinates[k], number));
    else if (coordinates.includes("x") && coordinates.includes("y") && !picture.joints) { this.write("position", "x", x); this.write("position", "y", y); }
  }
}

for (const panel of document.querySelectorAll("[data-preview]")) new Play(panel.closest("main").querySelector("#scene"), panel);
