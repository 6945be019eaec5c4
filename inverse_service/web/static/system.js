// A motion in the browser: the formulas that the service sends are interpreted here, never evaluated as text.

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

// What f divides by, and the like: where such a formula is zero, f may have no value.
function poles(tree) {
  if (!Array.isArray(tree)) return [];
  const [name, a, power] = tree;
  const own = name === "^" && power < 0 ? roots(a) : { log: [a], tan: [["cos", a]], sec: [["cos", a]], cot: [["sin", a]], csc: [["sin", a]], coth: [a], csch: [a] }[name] ?? [];
  return [...own, ...tree.slice(1).flatMap(poles)];
}
const roots = (tree) => (tree[0] === "*" ? tree.slice(1).flatMap(roots) : tree[0] === "^" ? roots(tree[1]) : [tree]);
const LARGE = 1e5; // times the forces before and after a pole, next to it

// The system of a form: accelerations and constraints as functions of one state.
export class System {
  constructor(told) {
    this.coordinates = told.coordinates;
    this.n = told.coordinates.length;
    const names = [...told.coordinates, ...told.coordinates.map((name) => `${name}'`), told.time ?? "t", ...Object.keys(told.values)];
    this.slots = new Map(names.map((name, k) => [name, k]));
    this.size = names.length;
    this.f = told.equations.map((tree) => compiled(tree, this.slots));
    this.w = told.constraints.map((tree) => compiled(tree, this.slots));
    this.poles = [...new Set(told.equations.flatMap(poles).map((pole) => JSON.stringify(pole)))].map((pole) => compiled(JSON.parse(pole), this.slots));
    if (told.multiplied) this.multiply(told.multiplied);
    this.sides = (told.domain ?? []).map((tree) => compiled(tree, this.slots)); // that keep their sign
  }

  state(positions, velocities, values) {
    const found = new Float64Array(this.size);
    found.set(positions);
    found.set(velocities, this.n);
    for (const [name, value] of Object.entries(values)) if (this.slots.has(name)) found[this.slots.get(name)] = value;
    return found;
  }

  // Whether the forces have no bound between two states, where a pole changes its sign.
  passes(before, after) {
    const force = (state) => Math.max(...this.f.map((f) => Math.abs(f(state))));
    return this.poles.some((pole) => {
      const [a, b] = [pole(before), pole(after)];
      if (!(a * b < 0)) return false;
      const near = before.map((x, k) => x + (after[k] - x) * (a / (a - b) + 1e-8));
      return force(near) > LARGE * (1 + force(before) + force(after));
    });
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

  // With multipliers M q'' = F + A^T l and A q'' + b = 0 have no pole where the accelerations solved for have one.
  multiply(told) {
    const made = (one) => (one?.list ? one.list.map(made) : compiled(one, this.slots));
    const [mass, force, rows, turned] = [told.mass, told.force, told.rows, told.turned].map(made);
    this.solved = (state) => {
      const a = rows.map((row) => row.map((part) => part(state)));
      const still = Array(a.length).fill(0);
      const free = mass.map((row, i) => [...row.map((part) => part(state)), ...a.map((one) => -one[i]), force[i](state)]);
      return solve([...free, ...a.map((row, i) => [...row, ...still, -turned[i](state)])]);
    };
    this.f = this.f.map((_, k) => (state) => this.solved(state)[k]);
    this.poles = [];
  }

  rate(state, into) {
    const solved = this.solved?.(state);
    for (let k = 0; k < this.n; k += 1) { into[k] = state[this.n + k]; into[this.n + k] = solved ? solved[k] : this.f[k](state); }
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

// One step of the classical method of order 4.
function runge(system, state, h, work) {
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
}

const [FORCED, FINER, AGREES, GROWS] = [0.1, [4, 16, 64, 256], 1e-3, 10]; // see `Steps`
// Steps of a motion, each made of `parts` of the classical method. Where a system divides by something and the change of the
// forces within a step would change the speed by more than FORCED of it, it is made of more parts, FINER times as many, until
// two of these agree to AGREES. Where none do and the forces change the speed by GROWS times it, there is no such step.
class Steps {
  constructor(system, h, parts, zero) {
    Object.assign(this, { system, h, parts, zero });
    this.work = Array.from({ length: 5 }, () => new Float64Array(system.size));
    this.last = new Float64Array(system.size);
  }

  // From `last` to the state after step `step`, made of so many parts.
  make(state, step, count) {
    const { system, h, zero, last, work } = this;
    state.set(last);
    this.most = 0; // of the forces
    for (let part = 0; part < count; part += 1) {
      runge(system, state, h / count, work);
      for (const force of work[0].subarray(system.n, 2 * system.n)) this.most = Math.max(this.most, Math.abs(force));
      state[2 * system.n] = zero + (step - 1) * h + ((part + 1) * h) / count;
    }
  }

  // Whether the state could be moved on by a step.
  take(state, step) {
    this.last.set(state);
    this.make(state, step, this.parts);
    if (!this.system.poles.length || !this.isForced(state)) return true;
    let before = null;
    for (const more of FINER) {
      this.make(state, step, this.parts * more);
      if (before && this.agree(before, state)) return true;
      before = Float64Array.from(state);
    }
    return this.h * this.most <= GROWS * this.scale;
  }

  // The speed before the step, or what the forces there would make of rest.
  get scale() {
    const { n, f } = this.system;
    return Math.max(...this.last.subarray(n, 2 * n).map(Math.abs), ...f.map((force) => this.h * Math.abs(force(this.last))));
  }

  isForced(state) {
    const change = Math.max(...this.system.f.map((f) => Math.abs(f(state) - f(this.last))));
    return !(this.h * change <= FORCED * this.scale);
  }

  agree(one, other) {
    const { n } = this.system;
    const most = AGREES * this.scale;
    return one.every((value, k) => k >= 2 * n || Math.abs(value - other[k]) <= (k < n ? this.h : 1) * most);
  }
}

// The columns {t, q, v} of `steps` steps h, each made of `parts` steps; ends where a number is not finite.
export function run(system, start, h, steps, parts = 1, each = null) {
  const state = Float64Array.from(start);
  const found = { t: [], q: system.coordinates.map(() => []), v: system.coordinates.map(() => []) };
  const zero = state[2 * system.n];
  const on = new Steps(system, h, parts, zero);
  for (let step = 0; step <= steps; step += 1) {
    const isMoved = !step || on.take(state, step);
    if (!isMoved || !state.every(Number.isFinite) || (step && system.poles.length && system.passes(on.last, state))) return { ...found, stopped: zero + step * h };
    if (each) { if (step) each(state); continue; }
    found.t.push(state[2 * system.n]);
    for (let k = 0; k < system.n; k += 1) { found.q[k].push(state[k]); found.v[k].push(state[system.n + k]); }
  }
  return found;
}

// "1/2", "0.1", "1e-3"; NaN for what is no number.
export function value(text) {
  const [top, below, ...more] = text.trim().split("/").map((part) => (part.trim() === "" ? NaN : Number(part)));
  return more.length ? NaN : below === undefined ? top : top / below;
}
