// Look: the recording over time and depth, with contact, ruptures and enhanced force of the online algorithms.
import { call, inOrder } from "./api.js";
import { h, fill, button, select, findings, table } from "./dom.js";
import { Chart, handle, link } from "./chart.js";

const COLOURS = { Stylet: "enhanced", Paper: "paper-algorithm" };
const AREAS = ["area0", "area1", "area2", "area3"];

export class LookView {
  constructor(root, app) {
    Object.assign(this, { root, app, algorithms: ["Stylet"], corrected: new Map(), handles: [] });
    this.empty = h("div", { class: "drop" }, h("p", {}, "No recording yet."), button("Choose recordings …", () => document.getElementById("chooser").click(), { class: "primary" }));
    this.bar = h("div", { class: "bar" });
    const plots = h("div", { class: "plots" });
    this.side = h("div", { class: "side" });
    this.body = h("div", { class: "split" }, h("div", {}, this.bar, plots), this.side);
    root.append(this.empty, this.body);
    this.time = new Chart(plots, { x: "time (s)", y: "force (N)", share: 0.31, label: "force over time" });
    this.depth = new Chart(plots, { x: "depth (mm)", y: "force (N)", share: 0.27, label: "force over depth", sorted: false, legend: false });
    this.motion = new Chart(plots, { x: "time (s)", y: "depth (mm)", share: 0.17, label: "depth over time" });
    this.speed = new Chart(plots, { x: "time (s)", y: "velocity (mm/s)", share: 0.17, label: "velocity over time" });
    link(this.time, this.depth, this.motion, this.speed);
    const zoomed = inOrder(window => this.app.attempt(() => this.load(window)));
    this.moved = zoomed;
    this.bindHandles();
    const wait = { timer: 0 };
    for (const chart of [this.time, this.motion, this.speed]) {
      chart.onzoom = window => { clearTimeout(wait.timer); wait.timer = setTimeout(() => zoomed(window ?? []), 120); };
    }
    for (const chart of [this.time, this.depth, this.motion, this.speed]) chart.onhover = index => this.read(index);
  }

  // What the user has moved in the recording shown: the contact, and ruptures as [algorithm, number, depth].
  corrections() { return this.corrected.get(this.app.file) ?? { contact_mm: null, ruptures_mm: [] }; }

  correct(change) {
    this.corrected.set(this.app.file, { ...this.corrections(), ...change });
    this.moved([]);
  }

  // Contact and ruptures of the first algorithm can be dragged over depth, or moved with the arrows. A new contact means new ruptures.
  bindHandles() {
    const moveContact = depth_mm => this.correct({ contact_mm: depth_mm, ruptures_mm: [] });
    const moveRupture = (number, depth_mm) => {
      const { algorithm } = this.found.runs[0], others = this.corrections().ruptures_mm.filter(([of, k]) => of !== algorithm || k !== number);
      this.correct({ ruptures_mm: [...others, [algorithm, number, depth_mm]] });
    };
    const contact = handle(this.depth.u, "contact", moveContact);
    contact.classList.add("contact");
    this.depth.ondraw = () => {
      const run = this.found?.runs[0], ruptures = run?.ruptures ?? [];
      contact.hidden = !run?.contact;
      if (run?.contact) contact.place(run.contact.depth_mm);
      while (this.handles.length > ruptures.length) this.handles.pop().remove();
      while (this.handles.length < ruptures.length) {
        const number = this.handles.length;
        this.handles.push(handle(this.depth.u, `rupture ${number + 1}`, depth_mm => moveRupture(number, depth_mm)));
        this.handles.at(-1).classList.add("rupture");
      }
      this.handles.forEach((element, k) => element.place(ruptures[k].depth_mm));
    };
  }

  async update() {
    const { file } = this.app, none = !file;
    this.empty.hidden = !none;
    this.body.hidden = none;
    if (none) return;
    await this.load([]);
  }

  async load(window) {
    const window_s = window.length === 2 ? window : undefined;
    const found = await call("look", { file: this.app.file, algorithms: this.algorithms, corrections: this.corrections(), window_s });
    const start = performance.now();
    this.found = found;
    this.draw(found, Boolean(window_s));
    if (!window_s) this.panel(found);
    this.root.dataset.drawn = `${found.file} ${found.samples[1]} ${Math.round(performance.now() - start)}`;
  }

  curve(force) {
    const own = COLOURS[force.name] || "measured";
    return force.role === "measured"
      ? { name: "measured", y: force.force_n, colour: "measured", width: 1.2 }
      : { name: `enhanced, ${force.name}`, y: force.force_n, colour: own, width: 1.8, dash: force.name === "Paper" ? [6, 3] : [] };
  }

  draw(found, zoomed) {
    const { curves, runs } = found, run = runs[0];
    const forces = [];
    for (const force of curves.forces) {
      if (force.role === "low") {
        const high = curves.forces.find(f => f.role === "high" && f.name === force.name);
        forces.push({ name: `enhanced, ${force.name}`, low: force.force_n, high: high.force_n, colour: COLOURS[force.name] });
      }
    }
    for (const force of curves.forces) if (force.role === "measured" || force.role === "enhanced") forces.push(this.curve(force));
    const bands = axis => run ? run.layers.map((layer, k) => ({ from: layer[axis][0], to: layer[axis][1], label: layer.label, colour: AREAS[k % 4] })) : [];
    const marks = axis => runs.flatMap(r => [
      ...(r.contact ? [{ x: r.contact[axis], label: "contact", colour: "contact", dash: [3, 3] }] : []),
      ...r.ruptures.map(rupture => ({ x: rupture[axis], label: rupture.label, colour: COLOURS[r.algorithm] === "enhanced" ? "rupture" : COLOURS[r.algorithm] }))]);
    const inside = bands("time_s").map(band => zoomed ? { ...band, from: Math.max(band.from, curves.time_s[0]), to: Math.min(band.to, curves.time_s.at(-1)) } : band).filter(band => band.to > band.from);
    for (const chart of [this.time, this.depth, this.motion, this.speed]) chart.quiet = true;
    this.time.set({ x: curves.time_s, curves: forces, bands: inside, marks: marks("time_s"), keepRange: zoomed });
    this.depth.set({ x: curves.depth_mm, curves: forces, bands: zoomed ? [] : bands("depth_mm"), marks: marks("depth_mm") });
    this.motion.set({ x: curves.time_s, curves: [{ name: "depth", y: curves.depth_mm, colour: "ink" }], bands: inside, keepRange: zoomed });
    this.speed.set({ x: curves.time_s, curves: [{ name: "velocity", y: curves.velocity_mm_per_s, colour: "ink" }], bands: inside, keepRange: zoomed });
    if (zoomed) {
      const { min, max } = this.time.u.scales.x;
      for (const chart of [this.motion, this.speed]) chart.u.setScale("x", { min, max });
    }
    queueMicrotask(() => queueMicrotask(() => { for (const chart of [this.time, this.depth, this.motion, this.speed]) chart.quiet = false; }));
  }

  read(index) {
    const { curves } = this.found, short = v => v === null ? "–" : String(Number(v.toPrecision(4)));
    if (index < 0) { this.time.reading.textContent = ""; return; }
    const forces = curves.forces.filter(f => f.role === "measured" || f.role === "enhanced").map(f => `${f.role === "measured" ? "measured" : f.name} ${short(f.force_n[index])} N`);
    this.time.reading.textContent = [`${short(curves.time_s[index])} s`, `${short(curves.depth_mm[index])} mm`, `${short(curves.velocity_mm_per_s[index])} mm/s`, ...forces].join("   ");
  }

  panel(found) {
    const { app } = this, file = found.file;
    fill(this.bar,
      select("recording", app.state.files, file, name => app.select(name)),
      h("span", { class: "soft" }, found.summary),
      h("fieldset", { class: "inline" }, h("legend", {}, "algorithm"), app.library.algorithms.map(name => h("label", {},
        h("input", { type: "checkbox", checked: this.algorithms.includes(name), onchange: event => this.choose(name, event.target.checked) }), ` ${name}`))));
    fill(this.side,
      findings(found.findings),
      found.runs.some(run => run.contact) && h("p", { class: "soft" }, "Wrong contact or rupture? Drag its handle in the plot over depth. ",
        this.corrected.has(file) && button("Back to what was detected", () => { this.corrected.delete(file); this.moved([]); }, { class: "quiet" })),
      found.runs.map(run => h("section", { class: "card" },
        h("h2", {}, run.algorithm),
        h("p", {}, run.contact_text),
        h("p", {}, `${run.ruptures.length} rupture${run.ruptures.length === 1 ? "" : "s"}`),
        run.table.rows.length > 0 && table(run.table, `layers found by ${run.algorithm}`),
        h("div", { class: "row" },
          button("Start a phantom from these layers →", () => app.attempt(async () => {
            await call("edit", { edit: { kind: "from_recording", file, algorithm: run.algorithm, corrections: this.corrections() } });
            app.views.phantom.along = file;
            await app.show("phantom", await call("state"));
          }), { class: "primary", disabled: !run.contact }),
          button("Write results", () => app.attempt(async () => {
            const written = await call("enhance", { file, algorithms: [run.algorithm], corrections: this.corrections() });
            app.alert(written.summary, "good", `${written.folder}/report.html`);
            await app.refresh();
          }))))),
      found.runs.length === 0 && h("p", { class: "soft" }, "Choose an algorithm."));
  }

  choose(name, on) {
    const chosen = new Set(this.algorithms);
    if (on) chosen.add(name); else chosen.delete(name);
    this.algorithms = this.app.library.algorithms.filter(a => chosen.has(a));
    return this.app.attempt(() => this.load([]));
  }
}
