// The map of a family: sliders, choices and clicks ask the page for another member and take over its parts; pointing
// says the answer by the equations of the sets, which the page carries.

import "./motion.js"; // which moves the pictures of the page
import { compiled } from "./system.js";

const PAUSE = 120; // ms after which a slider asks
const [SPAN, LEFT, TOP, SIDE] = [3, 44, 14, 470]; // as the service draws it
const NEAR = 7 * 2 * SPAN / SIDE; // pixels of the drawing, as a difference of constants
const STEP = 0.05;
const shown = (value) => String(Number(value.toPrecision(4))).replace("-", "\u2212");

class Explorer {
  constructor(section) {
    this.section = section;
    this.form = section.querySelector("form");
    this.told = JSON.parse(section.querySelector("[data-leaves]").textContent);
    const slots = new Map(this.told.letters.map((name, k) => [name, k]));
    // Of each set: what vanishes on it, and what vanishes nowhere on it.
    this.leaves = this.told.leaves.map((both) => both && both.map((trees) => trees.map((tree) => compiled(tree, slots))));
    this.motion = section.querySelector("[data-motion]")?.motion ?? null;
    this.form.addEventListener("input", (event) => this.changed(event));
    this.form.addEventListener("submit", (event) => { event.preventDefault(); this.ask(); });
    document.addEventListener("click", (event) => {
      const link = event.target.closest("[data-to]");
      if (!link || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      this.ask({ to: link.dataset.to });
    });
    this.listen();
  }

  get map() { return this.section.querySelector("[data-map]"); }

  values() { return this.told.letters.map((name) => Number(this.form.elements.namedItem(`at.${name}`).value)); }

  changed(event) {
    const { target } = event;
    if (target.dataset.for) this.form.elements.namedItem(target.dataset.for).value = target.value;
    else if (target.name.startsWith("at.")) this.form.querySelector(`[data-for="${target.name}"]`).value = target.value;
    this.move();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.ask(), PAUSE);
  }

  move() {
    if (!this.motion) return;
    this.values().forEach((value, k) => { if (this.told.letters[k] in this.motion.values) this.motion.values[this.told.letters[k]] = value; });
    this.motion.update(true);
  }

  // The page of these choices; only the last question is answered.
  async ask(besides = {}) {
    const query = new URLSearchParams({ ...Object.fromEntries(new FormData(this.form)), ...besides });
    const asked = (this.asked = `${this.form.action}?${query}`);
    let text;
    try {
      const answer = await fetch(asked);
      if (!answer.ok) return;
      text = await answer.text();
    } catch { return; }
    if (asked !== this.asked) return;
    const page = new DOMParser().parseFromString(text, "text/html");
    for (const part of ["[data-map]", "[data-member]"]) this.section.querySelector(part).replaceWith(page.querySelector(part));
    for (const input of page.querySelectorAll("[data-family] input[type=number]")) {
      const own = this.form.elements.namedItem(input.name);
      if (document.activeElement !== own) own.value = input.value;
      this.form.querySelector(`[data-for="${input.name}"]`).value = input.value;
      const label = input.closest("label").querySelector(".what").textContent;
      own.closest("label").querySelector(".what").textContent = label;
    }
    for (const name of Object.keys(besides)) query.delete(name);
    if (Object.keys(besides).length) this.move();
    for (const [k, name] of this.told.letters.entries()) query.set(`at.${name}`, String(this.values()[k]));
    history.replaceState(null, "", `${location.pathname}?${query}`);
    this.listen();
  }

  // A place of the pointer as the values of the constants.
  at(event) {
    const box = this.map.querySelector("svg").getBoundingClientRect();
    const scale = 560 / box.width;
    const x = ((event.clientX - box.left) * scale - LEFT) / SIDE * 2 * SPAN - SPAN;
    const y = SPAN - ((event.clientY - box.top) * scale - TOP) / SIDE * 2 * SPAN;
    return Math.max(Math.abs(x), Math.abs(y)) > SPAN ? null : [x, y];
  }

  listen() {
    const [svg, said] = [this.map.querySelector("svg"), this.map.querySelector("[data-pointed]")];
    const words = said.innerHTML;
    svg.setAttribute("tabindex", "0");
    svg.addEventListener("pointermove", (event) => {
      const place = this.at(event);
      if (!place) { said.innerHTML = words; return; }
      const [across, up] = [this.form.elements.across.value, this.form.elements.up.value];
      said.textContent = `${across} = ${shown(place[0])}, ${up} = ${shown(place[1])}: ${this.answer(this.placed(place))}`;
    });
    svg.addEventListener("pointerleave", () => { said.innerHTML = words; });
    svg.addEventListener("click", (event) => { const place = this.at(event); if (place) this.choose(place, true); });
    svg.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] }[event.key];
      if (!by) return;
      event.preventDefault();
      const [across, up] = ["across", "up"].map((key) => Number(this.form.elements.namedItem(`at.${this.form.elements[key].value}`).value));
      this.choose([across + by[0], up + by[1]].map((value) => Math.round(value / STEP) * STEP), false, true);
    });
  }

  placed([x, y]) {
    const values = this.values();
    values[this.told.letters.indexOf(this.form.elements.across.value)] = x;
    values[this.told.letters.indexOf(this.form.elements.up.value)] = y;
    return values;
  }

  async choose(place, near, focus = false) {
    ["across", "up"].forEach((key, k) => {
      const name = `at.${this.form.elements[key].value}`;
      this.form.elements.namedItem(name).value = Number(place[k].toFixed(4));
      this.form.querySelector(`[data-for="${name}"]`).value = place[k];
    });
    this.move();
    await this.ask(near ? { near: "1" } : {});
    if (focus) this.map.querySelector("svg").focus();
  }

  // The words of the last set that is near: f over its gradient.
  answer(values) {
    const distance = (f) => {
      const size = f(values);
      const slopes = values.map((_, k) => { const there = [...values]; there[k] += 1e-4; return (f(there) - size) / 1e-4; });
      return Math.abs(size) / (Math.hypot(...slopes) || 1);
    };
    const near = (f) => distance(f) <= NEAR;
    for (let k = this.leaves.length - 1; k > 0; k -= 1) {
      const [on, off] = this.leaves[k] ?? [];
      if (on?.every(near) && !off.some(near)) return this.told.said[k];
    }
    return this.told.said[0];
  }
}

for (const section of document.querySelectorAll("[data-family]")) new Explorer(section);
