// Phantom: layers with draggable faces on the force over depth, numbers as sliders, effects, and the predicted force.
import { call, inOrder } from "./api.js";
import { h, fill, button, select, slider } from "./dom.js";
import { Chart, handle, link } from "./chart.js";

const AREAS = ["area0", "area1", "area2", "area3"];
const CURVES = {
  measured: { colour: "measured", width: 1.2 },
  predicted: { colour: "predicted", width: 2 },
  tip: { colour: "tip", width: 1.4, dash: [5, 3] },
};

export class PhantomView {
  constructor(root, app) {
    Object.assign(this, { root, app, along: null, stroke: 0, handles: [], sliders: new Map(), shape: "" });
    this.bar = h("div", { class: "bar" });
    this.summary = h("output", { class: "summary" });
    const plots = h("div", { class: "plots" });
    this.side = h("div", { class: "side" });
    root.append(h("div", { class: "split" }, h("div", {}, this.bar, this.summary, plots), this.side));
    this.depth = new Chart(plots, { x: "depth (mm)", y: "force (N)", share: 0.46, label: "predicted force over depth; the faces of the layers can be dragged", sorted: false });
    this.time = new Chart(plots, { x: "time (s)", y: "force (N)", share: 0.26, label: "predicted force over time", legend: false });
    link(this.depth, this.time);
    for (const chart of [this.depth, this.time]) chart.onhover = index => this.read(index);
    this.depth.ondraw = () => this.placeHandles();
    this.send = inOrder(request => this.app.attempt(() => this.deliver(request)), request => request.transient);
  }

  async update() {
    if (this.along && !this.app.state.files.includes(this.along)) this.along = null;
    const asking = this.app.attempt(() => call("preview", { file: this.along }));
    this.panel(this.app.state.phantom, true);
    const preview = await asking;
    if (preview) this.draw(preview);
  }

  // One edit; those of a movement of the mouse share a stroke and are one step of undo.
  edit(edit, last = true) {
    return this.send({ edit, along: this.along, stroke: this.stroke, transient: !last });
  }

  discrete(edit) { this.stroke++; return this.edit(edit); }

  // The answer is drawn in the next frame, while the studio computes the next one.
  async deliver(request) {
    const answer = await call("edit", request);
    Object.assign(this.app.state, { phantom: answer.phantom, undo: answer.undo, redo: answer.redo });
    if (!this.latest) requestAnimationFrame(() => this.paint());
    this.latest = { answer, transient: request.transient };
  }

  paint() {
    const { answer, transient } = this.latest;
    this.latest = null;
    document.getElementById("undo").disabled = !answer.undo;
    document.getElementById("redo").disabled = !answer.redo;
    this.panel(answer.phantom, !transient);
    this.draw(answer.preview, transient);
    this.frames = (this.frames || 0) + 1;
    this.root.dataset.frames = this.frames;
  }

  draw(preview, keepRange = false) {
    const { curves, ruptures } = preview, { phantom } = this.app.state;
    this.curves = curves;
    const forces = curves.forces.map(force => ({ name: force.name, y: force.force_n, ...CURVES[force.role] }));
    const bands = phantom.layers.map((layer, k) => ({ from: phantom.faces_mm[k], to: phantom.faces_mm[k + 1], label: layer.name || `layer ${k + 1}`, colour: AREAS[k % 4] }));
    const marks = axis => ruptures.map(rupture => ({ x: rupture[axis], label: rupture.label, colour: "rupture" }));
    this.depth.set({ x: curves.depth_mm, curves: forces, bands, marks: [], keepRange });
    this.time.set({ x: curves.time_s, curves: forces, marks: marks("time_s"), keepRange });
    this.summary.textContent = preview.summary;
    this.root.dataset.drawn = String(curves.time_s.length);
  }

  read(index) {
    const short = v => v === null ? "–" : String(Number(v.toPrecision(4))), { curves } = this;
    this.depth.reading.textContent = index < 0 ? "" : [`${short(curves.time_s[index])} s`, `${short(curves.depth_mm[index])} mm`, ...curves.forces.map(f => `${f.name} ${short(f.force_n[index])} N`)].join("   ");
  }

  // The handles on the faces.
  placeHandles() {
    const faces = this.app.state?.phantom.faces_mm || [];
    while (this.handles.length > faces.length) this.handles.pop().remove();
    while (this.handles.length < faces.length) {
      const face = this.handles.length;
      this.handles.push(handle(this.depth.u, "", (depth_mm, last) => this.edit({ kind: "face", face, depth_mm }, last), () => this.stroke++));
    }
    for (const [k, element] of this.handles.entries()) {
      element.place(faces[k]);
      element.setAttribute("aria-label", k === 0 ? "surface" : k === faces.length - 1 ? "far face" : `face ${k}`);
    }
  }

  // A slider of the panel, kept as long as the panel has the same shape, so that it keeps the focus.
  slider(key, view, edit) {
    this.views.set(key, view);
    const row = slider(view, (to, last) => {
      if (!row.moving) { row.moving = true; this.stroke++; }
      if (last) row.moving = false;
      this.edit(edit(to), last);
    });
    this.sliders.set(key, row);
    return row;
  }

  panel(phantom, whole) {
    const shape = JSON.stringify([phantom.layers.map(l => l.sliders.length), phantom.effects.map(e => e.id), this.app.state.files, this.along, phantom.motion, phantom.layers.map(l => l.name), phantom.name]);
    if (shape === this.shape) {
      const update = (key, view) => this.sliders.get(key)?.update(view);
      phantom.layers.forEach((layer, k) => layer.sliders.forEach(s => update(`l${k}${s.field}`, s)));
      phantom.effects.forEach((effect, k) => effect.sliders.forEach(s => update(`e${k}${s.field}`, s)));
      phantom.tolerances.forEach(s => update(`t${s.field}`, s));
      if (whole) this.ron.value = phantom.ron;
      return;
    }
    this.shape = shape;
    this.sliders = new Map();
    this.views = new Map();
    this.fillBar(phantom);
    fill(this.side,
      h("div", { class: "row" },
        h("input", { type: "text", class: "name", value: phantom.name, "aria-label": "name of the phantom", onchange: event => this.discrete({ kind: "name", name: event.target.value }) }),
        button("Save", () => this.save(), { title: "writes phantom.ron" }),
        button("Simulate and score", () => this.simulate())),
      phantom.layers.map((layer, k) => this.layer(layer, k, phantom.layers.length)),
      this.effects(phantom),
      h("section", { class: "card" }, h("h2", {}, "Uncertainty of these values"),
        phantom.tolerances.map(s => this.slider(`t${s.field}`, s, to => ({ kind: "tolerance", field: s.field, to })))),
      this.text(phantom));
  }

  fillBar(phantom) {
    const { app } = this;
    fill(this.bar,
      select("start from", [["", "start from …"], ...app.library.scenarios], "", name => { if (name) { this.along = null; this.discrete({ kind: "scenario", name }); } }),
      select("motion", [["", "along its own motion"], ...app.state.files.map(file => [file, `along ${file}`])], this.along || "", file => { this.along = file || null; app.attempt(() => this.update()); }),
      !this.along && select("another motion", [["", phantom.motion.length > 46 ? phantom.motion.slice(0, 45) + "…" : phantom.motion], ...app.library.motions], "", name => { if (name) this.discrete({ kind: "motion", name }); }),
      app.state.plan && button("Use the planned motion", () => { this.along = null; this.discrete({ kind: "from_plan" }); }),
      app.state.files.length === 0 && h("span", { class: "soft" }, "Drag the faces by their handles or move the sliders: the force follows. Drop a recording anywhere on the page to compare it with this phantom."),
      app.state.files.length > 0 && button("Explain →", () => app.show("explain"), { class: "primary right" }));
  }

  layer(layer, k, count) {
    return h("section", { class: `card layer area${k % 4}` },
      h("div", { class: "row" },
        h("input", { type: "text", class: "name", value: layer.name, placeholder: `layer ${k + 1}`, "aria-label": `name of layer ${k + 1}`, onchange: event => this.discrete({ kind: "layer_name", layer: k, name: event.target.value }) }),
        button("Split", () => this.discrete({ kind: "split_layer", layer: k }), { class: "quiet", "aria-label": `Split layer ${k + 1}` }),
        button("Remove", () => this.discrete({ kind: "remove_layer", layer: k }), { class: "quiet", disabled: count < 2, "aria-label": `Remove layer ${k + 1}` })),
      layer.sliders.map(s => this.slider(`l${k}${s.field}`, s, to => ({ kind: "layer", layer: k, field: s.field, to }))));
  }

  effects(phantom) {
    const gallery = this.app.library.effects, about = id => gallery.find(e => e.id === id);
    return h("section", { class: "card" },
      h("h2", {}, "Effects"),
      select("add an effect", [["", "add an effect …"], ...gallery.map(e => [e.id, e.title])], "", id => { if (id) this.discrete({ kind: "add_effect", id }); }),
      phantom.effects.map((effect, k) => h("div", { class: "effect" },
        h("div", { class: "row" }, h("strong", {}, effect.title), button("Remove", () => this.discrete({ kind: "remove_effect", effect: k }), { class: "quiet right", "aria-label": `Remove ${effect.title}` })),
        h("p", { class: "soft" }, about(effect.id)?.signature),
        h("code", {}, about(effect.id)?.equation),
        effect.sliders.map(s => this.slider(`e${k}${s.field}`, s, to => ({ kind: "effect", effect: k, field: s.field, to }))))));
  }

  text(phantom) {
    this.ron = h("textarea", { rows: "14", spellcheck: "false", "aria-label": "scenario as RON", value: phantom.ron });
    return h("details", { class: "card" }, h("summary", {}, "As text (phantom.ron)"), this.ron,
      h("div", { class: "row" }, button("Apply", () => this.discrete({ kind: "ron", text: this.ron.value }))));
  }

  save() { return this.app.attempt(async () => { await this.app.refresh(await call("save")); this.app.alert("Saved as phantom.ron in the workspace.", "good"); }); }

  simulate() {
    return this.app.attempt(async () => {
      const done = await call("run");
      this.app.alert(`${done.summary}; report, recording and score are in ${done.folder}/`, "good", `${done.folder}/report.html`);
      await this.app.refresh();
    });
  }
}
