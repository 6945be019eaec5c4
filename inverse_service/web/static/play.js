// The form of a simulation with its motion: sliders and the dragged start write into the boxes, so that Run sends what is seen.

import { moving, PICTURES } from "./motion.js";
import { value as number } from "./system.js";

const value = (text) => number(text.split(",")[0]); // the first of a list
const isWrong = (text) => text.split(",").some((part) => part.trim() && Number.isNaN(number(part)));

const REDRAW_PAUSE = 250; // ms after which changed functions are asked for
const PRICE_PAUSE = 600; // ms after which what a step costs is asked for
const STEPS = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1, 2];
const power = (number) => number.toExponential(0).replace(/e([+-])/, (_, sign) => (sign === "-" ? "e\u2212" : "e"));
const duration = (s) => { const [size, unit] = s < 1e-3 ? [1e6, "\u00b5s"] : s < 1 ? [1e3, "ms"] : [1, "s"]; return `${Number((s * size).toPrecision(2))} ${unit}`; };
const short = (number) => String(Number(number.toPrecision(4)));

const figureOf = (panel) => panel.querySelector("[data-play-motion]");

class Play {
  constructor(form, panel) {
    Object.assign(this, { form, panel });
    this.part = Object.fromEntries(["picture", "told"].map((name) => [name, panel.querySelector(`[data-${name}]`)]));
    this.load();
    form.addEventListener("input", (event) => {
      if (event.target.name?.startsWith("function.") || event.target.value?.includes(",")) {
        clearTimeout(this.timer);
        this.timer = setTimeout(() => this.load(), REDRAW_PAUSE);
      } else this.read();
      this.remember();
    });
    this.part.picture.addEventListener("change", () => { this.motion.name = this.part.picture.value; this.motion.update(true); this.panel.querySelector("[data-caption]").hidden = this.motion.name !== this.motion.names[0]; });
    this.step = form.querySelector("[data-step]");
    this.step.addEventListener("input", (event) => {
      event.stopPropagation();
      const [span, h] = [this.span, STEPS[Number(this.step.value)]];
      this.form.elements.step.value = h;
      this.form.elements.steps.value = Math.max(1, Math.round(span / h)) || 1;
      this.tellPrice();
      this.read();
      this.remember();
    });
    form.addEventListener("change", () => { clearTimeout(this.pricing); this.pricing = setTimeout(() => this.askPrice(), PRICE_PAUSE); });
  }

  box(kind, name) { return this.form.elements.namedItem(`${kind}.${name}`); }

  numbers(kind, names) { return names.map((name) => value(this.box(kind, name)?.value ?? "")); }

  // Each error is shown next to its field.
  faults(told) {
    for (const box of this.form.querySelectorAll(".field input[name]")) {
      box.parentElement.querySelector(".fault")?.remove();
      box.toggleAttribute("aria-invalid", false);
      if (!(box.name in told)) continue;
      const fault = Object.assign(document.createElement("p"), { className: "fault", id: `${box.id}-fault`, textContent: told[box.name] });
      box.setAttribute("aria-invalid", "true");
      box.setAttribute("aria-describedby", fault.id);
      box.after(fault);
    }
  }

  // The address is the scene, before it is run.
  remember() {
    const fields = new URLSearchParams([...new FormData(this.form)].filter(([name, text]) => text || /^(position|velocity)/.test(name)));
    history.replaceState(null, "", `${location.pathname}?${fields}`);
  }

  get span() { return value(this.form.elements.step.value) * Number(this.form.elements.steps.value); }

  async load() {
    const answer = await fetch(this.panel.dataset.preview, { method: "POST", body: new URLSearchParams(new FormData(this.form)) });
    const told = answer.ok ? await answer.json() : { reason: "The service does not answer at the moment." };
    this.part.told.textContent = told.reason ?? "";
    this.faults(told.faults ?? {});
    figureOf(this.panel).hidden = told.reason !== undefined && !this.motion;
    if (told.reason !== undefined) return;
    const { coordinates } = told;
    const given = Object.fromEntries(Object.keys(told.values).map((name) => [name, value(this.box("parameter", name)?.value ?? "")]).filter(([, number]) => !Number.isNaN(number)));
    Object.assign(told, { given, values: { ...told.values, ...given }, span: this.span, start: this.start(coordinates) });
    const figure = figureOf(this.panel);
    figure.querySelector("[data-dials]").replaceChildren();
    this.motion?.play(false);
    this.motion = moving(figure, { told, changed: () => this.write() });
    if (!this.motion) return;
    figure.querySelector("[data-caption]").innerHTML = told.caption ?? "";
    this.part.picture.replaceChildren(...this.motion.names.map((name) => new Option(PICTURES[name].label, name)));
    this.part.picture.closest("span").hidden = this.motion.names.length < 2;
    this.askPrice();
  }

  // What the step costs by the first ticked method: measured at one step, carried to others by the order.
  async askPrice() {
    const h = value(this.form.elements.step.value);
    this.step.value = STEPS.findLastIndex((one) => one <= h * 1.001);
    const answer = await fetch("/simulate/price", { method: "POST", body: new URLSearchParams(new FormData(this.form)) });
    this.price = answer.ok ? await answer.json() : {};
    this.tellPrice();
  }

  tellPrice() {
    const [place, { step, order, error, seconds, method, parts = {}, reason = "" }] = [this.form.querySelector("[data-price]"), this.price ?? {}];
    const h = value(this.form.elements.step.value);
    // Of effects that act and have no part in a step, L has no terms.
    const isKnown = Object.keys(parts).length > 0;
    for (const price of this.form.querySelectorAll("[data-effect]")) {
      const one = parts[price.dataset.effect];
      const acts = this.form.querySelector(`[name=effect][value="${CSS.escape(price.dataset.effect)}"]`)?.checked;
      price.textContent = one !== undefined ? `${duration(Math.max(0, one))} a step` : isKnown && acts ? "no such terms" : "";
    }
    place.textContent = step === undefined || !(h > 0) ? reason : `${h}: error about ${power(error * (h / step) ** order)}, ${duration((seconds * step) / h)} (${method})`;
  }

  start(coordinates) {
    return { positions: this.numbers("position", coordinates).map((v) => (Number.isNaN(v) ? 0 : v)), velocities: this.numbers("velocity", coordinates) };
  }

  // The boxes were changed.
  read() {
    if (!this.motion) return;
    const { coordinates } = this.motion.told;
    const wrong = [...this.form.querySelectorAll("[name^='parameter.'], [name^='position.'], [name^='velocity.'], [name='step'], [name='steps']")]
      .filter((box) => isWrong(box.value));
    if (wrong.length) { this.faults(Object.fromEntries(wrong.map((box) => [box.name, `${box.value} is not a number.`]))); return; }
    this.faults({});
    for (const name of Object.keys(this.motion.values)) {
      const given = value(this.box("parameter", name)?.value ?? "");
      if (!Number.isNaN(given)) this.motion.values[name] = given;
    }
    ({ positions: this.motion.q, velocities: this.motion.v } = this.start(coordinates));
    if (!(this.span > 0)) { this.part.told.textContent = "The step must be greater than 0, the number of steps too."; return; }
    this.part.told.textContent = "";
    this.motion.told.span = this.span;
    this.motion.update(true);
  }

  // The picture was changed.
  write() {
    const { coordinates } = this.motion.told;
    const put = (kind, name, number) => { const box = this.box(kind, name); if (box && !box.value.includes(",") && (box.value.trim() || kind !== "velocity") && value(box.value) !== number) box.value = short(number); };
    for (const [name, number] of Object.entries(this.motion.values)) put("parameter", name, number);
    coordinates.forEach((name, k) => { put("position", name, this.motion.q[k]); put("velocity", name, this.motion.v[k]); });
    this.remember();
  }
}

for (const panel of document.querySelectorAll("[data-preview]")) new Play(document.querySelector("#scene"), panel);
