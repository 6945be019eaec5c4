// Makes the pages live. Everything here has a way without it.

import { moving } from "./motion.js";

const root = document.documentElement;

const ECHO_PAUSE = 120; // ms after the last key
const FAULT_PAUSE = 900; // a half-typed equation is no mistake
const ANSWER_PAUSE = 350; // a complete reading that is left alone is answered
const BUSY_PAUSE = 3000; // ms after which a stream that broke is looked at again
const AGAIN = [1000, 2000, 4000, 8000]; // ms after which a service that is busy or has just started is asked again
const BATCH_PAUSE = 700; // ms between two looks at a batch that is open
const LOOK_PAUSE = 150; // ms between two looks at a result that grows
const TALL = 12; // CSS pixels by which what scrolls down is higher than its box; brackets are a few higher
const CUT = 4; // the same for the answer beside the form, whose last line must not be cut without a sign
const DRAFT = "draft:";
const REST = "?rest=1"; // of an answer whose verdict came first

const FAILED = "The service failed on this text. This is an error of the program.";

// The answer to a form: a part of a page, or the sentence of a refusal. `isBusy`: the service has to be asked again.
async function post(address, form, signal) {
  const sent = new FormData(form);
  const file = sent.get("document");
  if (!(file instanceof File) || !file.name) sent.delete("document");
  const answer = await fetch(address, { method: "POST", body: sent, signal });
  const isPage = (answer.headers.get("content-type") ?? "").startsWith("text/html");
  return { isBusy: [429, 503].includes(answer.status), isPage, text: isPage ? await answer.text() : (await answer.json()).detail ?? FAILED };
}

// The question of a form as one text: what is typed and what a link has set. `as` "defaultValue": as the page came.
function questionOf(form, as = "value") {
  const fields = [...form.elements].filter((one) => one.name && (one.type === "textarea" || one.type === "text" || one.type === "hidden"));
  return textOf(fields.map((one) => [one.name, one[as].replaceAll("\r\n", "\n").trim()]));
}
const NO_QUESTION = ["kind", "name"]; // fields that leave the answer as it is
const textOf = (pairs) => JSON.stringify(pairs.filter(([name, text]) => text && !NO_QUESTION.includes(name)).sort());

// An answer whose form has been changed since fades. These forms have autocomplete off: what a browser would fill in
// after a reload or Back comes later than the page.
function fading(place, form) {
  const isAsServed = (one) => one.type === "radio" || one.type === "checkbox" ? one.checked === one.defaultChecked
    : one.options ? [...one.options].every((option) => option.selected === option.defaultSelected || one.selectedIndex === 0) : one.value === one.defaultValue;
  const look = () => isOld(place, [...form.elements].some((one) => one.name && one.type !== "submit" && !place.contains(one) && !isAsServed(one)));
  form.addEventListener("input", look);
  addEventListener("pageshow", look);
  look();
}

function isOld(place, old) {
  place.classList.toggle("old", old);
  place.toggleAttribute("aria-busy", old);
  if (old) place.setAttribute("aria-busy", "true");
}

function echo(form) {
  const target = document.getElementById(form.dataset.understood ?? "understood");
  let [timer, typed, scolding, tries] = [0, 0, 0, 0];
  let [asked, read] = [null, questionOf(form, "defaultValue")];
  const answering = form.dataset.answer ? answers(form) : null;
  const ask = async () => {
    asked?.abort();
    asked = new AbortController();
    read = questionOf(form);
    try {
      const { isBusy, isPage, text } = await post(`${form.dataset.echo}?fragment=1`, form, asked.signal);
      // What was typed while the service starts is read once it has started.
      if (isBusy && tries < AGAIN.length) { timer = setTimeout(ask, AGAIN[tries++]); return; }
      clearTimeout(scolding);
      const isFault = !isPage || text.includes("data-problem");
      const show = () => {
        // What was read before is not left standing under what is typed now.
        if (isPage) target.innerHTML = text;
        else target.textContent = text;
        isOld(target, false);
        focusWide(target);
        mark(form, target);
        // A screen reader hears where it ends, not each letter on the way.
        if (isFault) { said(target.querySelector(".detail")?.textContent ?? ""); answering?.clear(); }
        else answering?.(typed);
      };
      if (isFault && Date.now() - typed < FAULT_PAUSE) scolding = setTimeout(show, FAULT_PAUSE - (Date.now() - typed));
      else show();
    } catch (error) {
      if (error.name === "AbortError") return;
      isOld(target, false);
      target.textContent = "The service does not answer at the moment.";
      answering?.clear();
    }
  };
  target.addEventListener("click", (event) => meant(form, event));
  form.addEventListener("input", (event) => {
    // Other equations are no longer the example whose name the form carries.
    if (event.target.tagName === "TEXTAREA") {
      if (form.elements.name) form.elements.name.value = "";
      document.querySelector(".tiles [aria-current]")?.removeAttribute("aria-current");
    }
    clearTimeout(timer);
    clearTimeout(scolding);
    if (event.target.dataset.backed) backed(event.target);
    [typed, tries] = [Date.now(), 0];
    if (event.target.type !== "checkbox") isOld(target, true);
    answering?.forget();
    timer = setTimeout(ask, ECHO_PAUSE);
  });
  mark(form, target);
  // What a browser or a draft has filled in is read as if it were typed.
  const renew = () => {
    const isOther = questionOf(form) !== read;
    if (isOther) { isOld(target, true); answering?.forget(); ask(); }
    return isOther;
  };
  addEventListener("pageshow", renew);
  return { ask, renew, answering };
}

// Behind a box lies a copy of its text, in which a place is marked; the line below the box says it without scripts.
function backed(box, start = 0, end = 0) {
  if (!box.dataset.backed) {
    const around = Object.assign(document.createElement("div"), { className: "typed" });
    box.before(around);
    around.append(Object.assign(document.createElement("pre"), { ariaHidden: "true" }), box);
    box.dataset.backed = "yes";
    box.addEventListener("scroll", () => { [copy.scrollTop, copy.scrollLeft] = [box.scrollTop, box.scrollLeft]; });
  }
  const copy = box.previousElementSibling;
  const [before, marked, after] = [box.value.slice(0, start), box.value.slice(start, end), box.value.slice(end)];
  copy.replaceChildren(...(end ? [before, Object.assign(document.createElement("mark"), { textContent: marked.trim() ? marked : "\u00a0" }), `${after}\u200b`] : []));
  copy.style.right = `${box.offsetWidth - box.clientWidth - 2}px`; // beside a scroll bar lines end earlier
  [copy.scrollTop, copy.scrollLeft] = [box.scrollTop, box.scrollLeft];
  box.toggleAttribute("aria-invalid", false);
  if (end) box.setAttribute("aria-invalid", "true");
}

function mark(form, within) {
  for (const box of form.querySelectorAll("textarea")) {
    const [, line, column, length] = within.querySelector(`[data-at^="${box.name}:"]`)?.dataset.at.split(":").map(Number) ?? [];
    if (!line) { if (box.dataset.backed) backed(box); continue; }
    const start = box.value.split("\n").slice(0, line - 1).reduce((sum, one) => sum + one.length + 1, column - 1);
    backed(box, start, start + length);
  }
}

// A reading that was chosen is put where it belongs; without scripts the service does the same.
function meant(form, event) {
  const [, name, line, column, length, text] = event.target.value?.match(/^(\w+):(\d+):(\d+)(?:\+(\d+))?:(.+)$/) ?? [];
  const field = text && form.elements.namedItem(name);
  if (!field) return;
  event.preventDefault();
  if (name === "parameters") {
    field.value = [field.value, text].filter(Boolean).join(", ");
  } else {
    const lines = field.value.split("\n");
    const [before, rest] = [lines[line - 1].slice(0, column - 1), lines[line - 1].slice(column - 1)];
    lines[line - 1] = before + text + (length ? rest.slice(length) : rest.replace(/^\\?[\p{L}\p{N}_]+/u, ""));
    field.value = lines.join("\n");
    field.focus();
  }
  field.dispatchEvent(new Event("input", { bubbles: true }));
}

function said(text) {
  const place = document.getElementById("said");
  if (place) place.textContent = text;
}

// The answer next to the form. Only one request runs at a time: a dropped one would cost the service as much.
function answers(form) {
  let place = document.getElementById("glance");
  const panel = place.closest(".live");
  let [timer, version, busy, again, tries] = [0, 0, false, false, 0];
  let motion = null;
  // The pane carries the question that it answers; beside any other it fades.
  const agree = () => {
    const question = place.querySelector("[data-question]")?.dataset.question;
    const isAnswered = question !== undefined && textOf(JSON.parse(question)) === questionOf(form);
    isOld(panel, question !== undefined && !isAnswered);
    return isAnswered;
  };
  const show = () => {
    panel.hidden = false;
    agree();
    motion?.play(false);
    const data = place.querySelector("script");
    const svg = panel.querySelector("svg");
    const [wasAway, isAway] = [svg.classList.contains("hidden"), !data && Boolean(place.querySelector("[data-settled]"))];
    svg.classList.toggle("hidden", isAway);
    if (wasAway !== isAway) { // in its other room it is new, and has not been moved there
      const fresh = place.cloneNode(true);
      place.replaceWith(fresh);
      place = fresh;
    }
    svg.classList.toggle("blank", !data); // whose room is kept for the next answer
    motion = data ? moving(panel, { small: true }) : null;
    focusWide(panel);
  };
  const ask = async () => {
    if (busy) { again = true; return; }
    busy = true;
    const mine = version;
    // The answer to the page as it came is being made, or its verdict came before its formulas.
    const { coming } = place.dataset;
    const more = coming ? `?coming=${coming}` : agree() && place.querySelector("[data-cut]") ? REST : "";
    delete place.dataset.coming;
    const answer = await post(form.dataset.answer + more, form).catch(() => null); // the form works without
    busy = false;
    if (again) { again = false; ask(); return; }
    if (!answer || mine !== version) return;
    if (answer.isBusy && tries < AGAIN.length) { timer = setTimeout(ask, AGAIN[tries++]); return; }
    if (answer.isBusy && more === REST) return; // the verdict stays
    if (answer.isPage) place.innerHTML = answer.text;
    else place.textContent = answer.text;
    show();
    if (place.querySelector("[data-cut]")) ask();
    said([...place.querySelectorAll("h2, p, .formula")].map((part) => part.getAttribute("aria-label") ?? part.textContent).join(" "));
  };
  const later = (typed) => {
    clearTimeout(timer);
    tries = 0;
    if (!agree()) timer = setTimeout(ask, Math.max(0, ANSWER_PAUSE - (Date.now() - typed)));
  };
  // What was typed since has no answer yet: the old one fades, and goes where the text cannot be read.
  later.forget = () => {
    version += 1;
    delete place.dataset.coming;
    clearTimeout(timer);
    agree();
    said("");
  };
  later.clear = () => { panel.hidden = true; place.replaceChildren(); motion?.play(false); };
  if (place.querySelector("[data-settled]")) show();
  if (place.querySelector("[data-cut]")) ask();
  panel.addEventListener("click", () => { if (getComputedStyle(panel).position === "fixed") form.requestSubmit(); });
  return later;
}

// What is typed survives a reload and the other tab: the draft of each form, until this window is closed.
function drafts(form) {
  const name = `${DRAFT}${location.pathname}:${form.elements.kind?.value ?? ""}`;
  const fields = [...form.querySelectorAll("textarea, input:not([type])")];
  const asks = location.search && !location.search.startsWith("?kind=");
  const kept = asks || document.querySelector("[data-problem]") ? null : JSON.parse(sessionStorage.getItem(name) ?? "null");
  if (kept) {
    for (const field of fields) {
      if (field.name in kept) field.value = kept[field.name];
    }
  }
  const keep = () => sessionStorage.setItem(name, JSON.stringify(Object.fromEntries(fields.map((field) => [field.name, field.value]))));
  form.addEventListener("input", keep);
  form.addEventListener("submit", keep);
}

// One's own Lagrangian survives a reload until it has been sent.
function keeping(box) {
  const name = `${DRAFT}${location.pathname.split("/").slice(0, 3).join("/")}:${box.name}`;
  box.value ||= sessionStorage.getItem(name) ?? "";
  box.addEventListener("input", () => sessionStorage.setItem(name, box.value));
}

// A formula is a stop of the tab key only where there is something to scroll to.
function focusWide(within) {
  for (const place of within.querySelectorAll(".formula, .asked, .answer > div > div, .scroll, .proof > li, .manual > table, #glance")) {
    const higher = place.id === "glance" ? CUT : TALL;
    if (place.scrollWidth > place.clientWidth + 1 || place.scrollHeight > place.clientHeight + higher) place.tabIndex = 0;
    else place.removeAttribute("tabindex");
  }
}

function themes(form) {
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const chosen = event.submitter?.value ?? "";
    if (chosen) root.dataset.theme = chosen;
    else delete root.dataset.theme;
    for (const button of form.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.value === chosen));
    fetch(form.action, { method: "POST", body: new URLSearchParams({ theme: chosen, back: "/livez" }), keepalive: true });
    document.dispatchEvent(new Event("colors"));
  });
}

function submitKey(form) {
  form.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) form.requestSubmit();
  });
}

// A word on a button for a moment, which a screen reader hears too.
function tell(button, word) {
  const label = button.dataset.label ?? button.textContent;
  const called = button.getAttribute("aria-label");
  const heard = document.querySelector("main").appendChild(Object.assign(document.createElement("span"), { className: "visually-hidden", role: "status" }));
  button.dataset.label = label;
  button.textContent = word;
  if (called && called !== word) button.setAttribute("aria-label", word);
  setTimeout(() => (heard.textContent = word), 50); // a region speaks what changes in it
  setTimeout(() => {
    button.textContent = label;
    if (called && called !== word) button.setAttribute("aria-label", called);
    heard.remove();
  }, 1600);
}

const isPlain = (event) => !(event.metaKey || event.ctrlKey || event.shiftKey);

// What buttons and links do; those that come later do it, too.
const CLICKS = {
  // Copies a text: that of an element, or LaTeX that a button carries.
  "[data-copy], [data-tex]": async (button) => {
    const place = document.getElementById(button.dataset.copy ?? "");
    try {
      await navigator.clipboard.writeText(button.dataset.tex ?? place.textContent);
      tell(button, "Copied");
    } catch {
      if (place) getSelection().selectAllChildren(place);
      tell(button, place ? "Selected" : "Not allowed");
    }
  },
  "[data-share]": async (link, event) => {
    if (!isPlain(event) || !navigator.clipboard) return;
    event.preventDefault();
    await navigator.clipboard.writeText(new URL(link.getAttribute("href"), location.href).href);
    tell(link, "Link copied");
  },
  // The answer to a further question takes the place of the link to it.
  "[data-here]": async (link, event) => {
    if (!isPlain(event)) return;
    event.preventDefault();
    const answer = await fetch(link.dataset.here).catch(() => null);
    if (!answer?.ok) { location.href = link.href; return; }
    const around = link.parentElement;
    around.innerHTML = await answer.text();
    focusWide(around);
  },
  // Rows and programs are shown on demand; without scripts rows are open, and programs are links.
  "[data-toggle]": (button) => unfold(button.dataset.toggle, !document.getElementById(button.dataset.toggle).classList.contains("shown")),
  "[data-code]": async (link, event) => {
    if (!isPlain(event)) return;
    event.preventDefault();
    const answer = await fetch(link.href);
    const shown = document.querySelector("[data-code-shown]");
    shown.hidden = false;
    shown.querySelector("pre").textContent = answer.ok ? await answer.text() : "This program could not be written.";
    for (const other of document.querySelectorAll("[data-code]")) (other === link ? other.setAttribute("aria-current", "true") : other.removeAttribute("aria-current"));
  },
  // All members are asked for at once; without scripts the link leads to the form that asks.
  'a[href*="family=yes"]': (link, event) => {
    const form = document.getElementById("members");
    if (!form || !isPlain(event)) return;
    event.preventDefault();
    form.submit();
  },
  'a[href^="#"]': (link) => { const part = document.querySelector(link.getAttribute("href")); if (part?.tagName === "DETAILS") part.open = true; },
  "[data-forget]": (button) => { localStorage.removeItem(HISTORY); button.closest("[data-history-list]").hidden = true; },
};
document.addEventListener("click", (event) => {
  for (const [selector, act] of Object.entries(CLICKS)) {
    const found = event.target.closest?.(selector);
    if (found) act(found, event);
  }
});

function unfold(id, isShown) {
  const [row, button] = [document.getElementById(id), document.querySelector(`[data-toggle="${id}"]`)];
  if (!row) return;
  row.classList.toggle("shown", isShown);
  button.setAttribute("aria-expanded", String(isShown));
  button.textContent = isShown ? "Hide" : "Show";
  focusWide(row);
}

// One's own questions, kept in this browser alone.
const HISTORY = "questions";
const MOST_KEPT = 50;
function asked() {
  try { return JSON.parse(localStorage.getItem(HISTORY) ?? "[]").filter((one) => /^\/results\/[\w-]+$/.test(one.path)); } catch { return []; }
}

function remembering() {
  const result = document.querySelector("[data-history]");
  if (result) {
    const path = location.pathname.split("/").slice(0, 3).join("/");
    const kept = [{ path, title: result.dataset.history }, ...asked().filter((one) => one.path !== path)];
    localStorage.setItem(HISTORY, JSON.stringify(kept.slice(0, MOST_KEPT)));
  }
  const list = document.querySelector("[data-history-list]");
  if (!list || !asked().length) return;
  list.hidden = false;
  for (const one of asked()) {
    const item = list.querySelector("ul").appendChild(document.createElement("li"));
    item.append(Object.assign(document.createElement("a"), { href: one.path, textContent: one.title }));
  }
}

// The page of open work fills in place: each part that changed is replaced, what was opened stays open.
const written = new WeakMap(); // part -> as the service wrote it
function note(within) {
  for (const part of within.querySelectorAll("[data-part]")) written.set(part, part.innerHTML);
}

const toldOf = (figure) => figure.querySelector("script")?.textContent;

function renew(text) {
  const fresh = new DOMParser().parseFromString(text, "text/html");
  fresh.querySelectorAll("noscript").forEach((one) => one.remove()); // parsed as if there were no scripts
  const [main, next] = [document.querySelector("main"), fresh.querySelector("main")];
  // A page with its own scripts is loaded as a whole.
  if ([...fresh.scripts].some((one) => one.src && ![...document.scripts].some((old) => old.src === one.src))) { location.reload(); return; }
  const opened = [...main.querySelectorAll(".why.shown")].map((row) => row.id);
  const [before, after] = [main, next].map((place) => place.querySelector(".hero > [data-motion]"));
  const [isWide, isNowWide] = [before, after].map((figure) => Boolean(figure?.parentElement.classList.contains("wide")));
  const [old, parts] = [main, next].map((place) => [...place.querySelectorAll("[data-part]")]);
  note(next);
  if (!old.length || old.length !== parts.length || (after && !before) || isWide !== isNowWide) {
    main.replaceChildren(...next.childNodes);
    parts.forEach((part) => written.set(part, part.innerHTML));
    for (const figure of main.querySelectorAll("[data-motion]")) moving(figure);
  } else old.forEach((part, k) => {
    if (written.get(part) === written.get(parts[k])) return;
    written.set(part, written.get(parts[k]));
    for (const name of ["class", "hidden"]) parts[k].hasAttribute(name) ? part.setAttribute(name, parts[k].getAttribute(name)) : part.removeAttribute(name);
    part.replaceChildren(...parts[k].childNodes);
    for (const figure of part.querySelectorAll("[data-motion]")) moving(figure);
  });
  // The picture of the whole answer may say more than that of its first part.
  if (before?.isConnected && after && !next.querySelector("[data-events]") && !before.motion?.isMoved && toldOf(before) !== toldOf(after)) {
    before.motion?.play(false);
    before.replaceWith(after);
    moving(after);
  }
  document.title = fresh.title;
  opened.forEach((id) => unfold(id, true));
  focusWide(main);
}

function following() {
  const place = document.querySelector("[data-events]");
  if (!place) return;
  const began = Date.now() - 1000 * Number(place.querySelector("[data-seconds]").dataset.seconds);
  const within = (name) => document.querySelector(`[data-events] [data-${name}]`);
  const say = (text) => { const line = within("progress"); if (line && line.textContent !== text) line.textContent = text; };
  const source = new EventSource(place.dataset.events);
  let [asking, again, end, over] = [false, false, false, false];
  const ticking = setInterval(() => { const clock = within("seconds"); if (clock) clock.textContent = `${Math.round((Date.now() - began) / 1000)} s`; }, 1000);
  const look = async () => {
    if (asking) { again = true; return; }
    asking = true;
    try {
      const answer = await fetch(location.pathname + location.search, { headers: { Accept: "text/html" } });
      const text = await answer.text();
      if (answer.ok) renew(text);
      end = answer.ok && !document.querySelector("[data-events]");
    } catch { again = true; }
    asking = false;
    if (end) { source.close(); clearInterval(ticking); remembering(); } else if (again || over) { again = false; setTimeout(look, LOOK_PAUSE); }
  };
  source.addEventListener("part", look);
  for (const kind of ["message", "progress", "status"]) source.addEventListener(kind, (event) => {
    let told = {};
    try { told = JSON.parse(event.data); } catch { return; }
    if (["successful", "failed", "dismissed"].includes(told.status)) { over = true; source.close(); look(); return; }
    const heading = within("waiting");
    if (told.status === "running" && heading) heading.textContent = "Working on it";
    const progress = told.progress ?? (told.status ? null : told);
    const text = typeof progress === "object" ? (progress?.stage ?? progress?.message) : progress;
    if (text && heading) say(String(text)); // a page with a part of the answer says itself what is looked for
  });
  source.addEventListener("error", () => {
    say("The service is not responding. Your request is saved, and this page continues when the service is back.");
    if (source.readyState === EventSource.CLOSED) setTimeout(look, BUSY_PAUSE);
  });
}

// The table of a batch that is open fills in.
async function batchProgress() {
  const answer = await fetch(location.pathname, { headers: { Accept: "text/html" } }).catch(() => null);
  if (answer?.ok) renew(await answer.text());
  if (!answer?.ok || document.querySelector("[data-open]")) setTimeout(batchProgress, answer?.ok ? BATCH_PAUSE : BUSY_PAUSE);
}

// A part of a page that was not ready with it.
async function later(place, tries = 0) {
  const answer = await fetch(place.dataset.later).catch(() => null);
  if (answer?.ok) {
    const part = document.createRange().createContextualFragment(await answer.text());
    const figures = [...part.querySelectorAll("[data-motion]")];
    place.replaceWith(part);
    for (const figure of figures) moving(figure);
    focusWide(document);
  } else if (tries < AGAIN.length) setTimeout(() => later(place, tries + 1), AGAIN[tries]);
  else place.querySelector("[role=status]").textContent = "The service is busy. Load this page again later.";
}

for (const place of document.querySelectorAll("[data-later]")) later(place);
for (const form of document.querySelectorAll("form[data-echo]")) {
  const { ask, renew, answering } = echo(form);
  if (form.dataset.understood) form.addEventListener("focusin", ask, { once: true });
  else {
    drafts(form);
    // A service that just started shows the form before it can say how the form is read.
    const isRead = document.querySelector("#understood .formula, #understood [data-problem]");
    if (!renew()) {
      if (!isRead) ask();
      else if (!document.querySelector("[data-settled], [data-problem]")) answering?.(0);
    }
  }
  submitKey(form);
  form.querySelector("input[type=file]")?.addEventListener("change", ask);
}
for (const box of document.querySelectorAll("#own textarea")) keeping(box);
for (const place of document.querySelectorAll("[data-answers]")) fading(place, document.getElementById(place.dataset.answers));
note(document);
remembering();
focusWide(document);
addEventListener("resize", () => focusWide(document));
document.fonts.addEventListener("loadingdone", () => focusWide(document)); // which makes formulas wider
for (const details of document.querySelectorAll("details")) details.addEventListener("toggle", () => focusWide(details));
// A hint opens after the one before it. The verdict takes the focus after an answer.
const hints = [...document.querySelectorAll("[data-hint]")];
hints.forEach((hint, k) => {
  if (k) hint.dataset.later = "";
  hint.addEventListener("toggle", () => { if (hint.open && hints[k + 1]) delete hints[k + 1].dataset.later; });
  hint.querySelector("summary").addEventListener("click", (event) => { if ("later" in hint.dataset) event.preventDefault(); });
});
document.querySelector("#feedback > h2") ? document.getElementById("feedback").focus() : document.referrer.startsWith(location.origin) && document.querySelector("h1#verdict")?.focus({ preventScroll: true });
const PAPER = 620; // CSS pixels between the margins of a page, with a step's number in front
addEventListener("beforeprint", () => {
  for (const place of document.querySelectorAll("[data-today]")) place.textContent = new Date().toISOString().slice(0, 10);
  for (const details of document.querySelectorAll("main .parts > details:not([open]), main details.written:not([open])")) {
    details.open = true;
    details.dataset.printed = "";
  }
  for (const math of document.querySelectorAll("main math")) {
    // What is in it is measured, as it fills the width itself; small fractions shrink less, so that is done again.
    const inside = document.createRange();
    inside.selectNodeContents(math);
    for (let share = 1, size = 1; size > 0.1; math.style.fontSize = `${size.toFixed(3)}em`) {
      share = PAPER / Math.max(1, inside.getBoundingClientRect().width);
      if (share >= 1) break;
      size *= Math.min(share, 0.95);
    }
  }
});
addEventListener("afterprint", () => {
  for (const details of document.querySelectorAll("details[data-printed]")) {
    details.open = false;
    delete details.dataset.printed;
  }
  for (const math of document.querySelectorAll("main math[style]")) math.removeAttribute("style");
});
for (const form of document.querySelectorAll("[data-theme-form]")) themes(form);
following();
if (document.querySelector("[data-batch] [data-open]")) batchProgress();
