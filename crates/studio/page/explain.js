// Explain: diagnosis with progress, causes on and off, the next insertion, prediction.
import { call } from "./api.js";
import { h, fill, button, table } from "./dom.js";
import { Chart } from "./chart.js";

const POLL_MS = 300;
const CURVES = { measured: { colour: "measured", width: 1.2 }, assumed: { colour: "assumed", width: 1.6, dash: [6, 3] }, extended: { colour: "predicted", width: 2 } };
const LIMITS = [["depth_mm", "deepest position", "mm"], ["speed_mm_per_s", "largest speed", "mm/s"], ["acceleration_mm_per_s2", "largest acceleration", "mm/s²"], ["duration_s", "longest duration", "s"], ["force_n", "largest force", "N"]];

export class ExplainView {
  constructor(root, app) {
    Object.assign(this, { root, app, chosen: null, off: new Set(), shown: "" });
    this.start = h("section", { class: "card" });
    this.job = h("section", { class: "card", "aria-live": "polite" });
    this.result = h("div", {});
    this.next = h("div", {});
    const plots = h("div", { class: "plots" });
    this.chartBox = h("div", {}, plots);
    this.report = h("div", {});
    root.append(h("div", { class: "split" }, h("div", {}, this.result, this.chartBox, this.report), h("div", { class: "side" }, this.start, this.job, this.next)));
    this.chart = new Chart(plots, { x: "time (s)", y: "force (N)", share: 0.36, label: "measured, assumed and diagnosed force over time" });
  }

  async update() {
    const { state } = this.app;
    if (this.chosen) for (const file of [...this.chosen]) if (!state.files.includes(file)) this.chosen.delete(file);
    if (!this.chosen) this.chosen = new Set(state.diagnosis?.files.filter(file => state.files.includes(file)) || []);
    if (this.chosen.size === 0) for (const file of state.files) this.chosen.add(file);
    this.paintStart();
    this.paintJob(state.job);
    this.paintResult(state.diagnosis);
    this.paintNext();
    await this.paintCurves();
    if (state.job?.state === "running" && !this.polling) this.poll();
  }

  files() { return [...this.chosen]; }

  paintStart() {
    const { state } = this.app;
    fill(this.start, h("h2", {}, "What does the phantom get wrong?"),
      state.files.length === 0 && h("p", {}, "Drop recordings first."),
      state.files.map(file => h("label", { class: "block" },
        h("input", { type: "checkbox", checked: this.chosen.has(file), onchange: event => { if (event.target.checked) this.chosen.add(file); else this.chosen.delete(file); this.paintStart(); } }), ` ${file}`)),
      state.files.length === 1 && h("p", { class: "soft" }, "With two or more recordings the gain is measured on those left out."),
      h("div", { class: "row" }, button("Diagnose", () => this.begin("diagnose", { files: this.files() }), { class: "primary", disabled: this.chosen.size === 0 || state.job?.state === "running" })));
  }

  async begin(name, request) {
    await this.app.attempt(async () => {
      if (name === "diagnose") this.of = JSON.stringify(this.app.state.phantom);
      this.app.state.job = await call(name, request);
      this.paintJob(this.app.state.job);
      this.paintStart();
      this.poll();
    });
  }

  async poll() {
    if (this.polling) return;
    this.polling = true;
    try {
      let job = await call("job");
      while (job && job.state === "running") {
        this.paintJob(job);
        await new Promise(resolve => setTimeout(resolve, POLL_MS));
        job = await call("job");
      }
      this.off.clear();
      this.shown = "";
      await this.app.refresh();
      if (job?.state === "failed") this.app.alert(job.error);
    } catch (error) {
      this.app.alert(error.message);
    } finally {
      this.polling = false;
    }
  }

  paintJob(job) {
    this.job.hidden = !job || job.state === "done";
    if (this.job.hidden) return;
    const running = job.state === "running", names = { diagnose: "Diagnosis", plan: "Plan", predict: "Prediction" };
    fill(this.job, h("h2", {}, `${names[job.kind]}: ${job.state}, ${Math.round(job.elapsed_s)} s`),
      running && h("progress", { "aria-label": "in progress" }),
      running && h("p", { class: "soft" }, "Seconds to a few minutes; the other views can be used meanwhile."),
      h("ol", { class: "stages" }, job.stages.slice(-6).map(stage => h("li", {}, stage))),
      job.error && h("p", { class: "bad" }, job.error),
      running && button("Cancel", () => this.app.attempt(async () => { this.app.state.job = await call("cancel"); this.paintJob(this.app.state.job); })));
  }

  paintResult(found) {
    const { app } = this;
    if (!found) {
      fill(this.result, h("div", { class: "hero" }, h("h2", {}, "Compare the phantom with recordings"),
        h("p", {}, "The diagnosis fits the phantom's layers to the recordings, searches the library of effects for what the phantom lacks, and says how much better the extended phantom predicts."),
        app.state.files.length > 0 && h("p", { class: "soft" }, "Start from the layers that were found (view Look), or draw your own (view Phantom).")));
      fill(this.report);
      return;
    }
    const switches = found.causes.map(cause => h("section", { class: "card cause" },
      h("label", {}, h("input", { type: "checkbox", checked: !this.off.has(cause.id), onchange: event => { if (event.target.checked) this.off.delete(cause.id); else this.off.add(cause.id); app.attempt(() => this.paintCurves()); } }), " ", h("strong", {}, cause.title)),
      cause.lines.map(line => h("p", {}, line))));
    const old = this.of && this.of !== JSON.stringify(app.state.phantom);
    fill(this.result,
      h("div", { class: `hero verdict ${old ? "old" : found.verdict}` },
        old && h("p", {}, "The phantom has changed since this diagnosis. Press Diagnose for the one that is drawn now."),
        h("h2", {}, found.sentence), h("p", {}, `${found.gain} Diagnosed: ${found.files.join(", ")}.`)),
      h("div", { class: "causes" }, switches),
      h("div", { class: "row" },
        button("Keep this model as the phantom", () => app.attempt(async () => {
          await call("edit", { edit: { kind: "from_diagnosis" } });
          app.views.phantom.along = app.file;
          await app.show("phantom", await call("state"));
        }), { class: "primary" }),
        h("span", { class: "soft" }, "extended.ron is in the workspace, in diagnosis/")));
    if (this.shown === found.folder + found.sentence + found.gain) return;
    this.shown = found.folder + found.sentence + found.gain;
    fill(this.report,
      h("details", { open: true }, h("summary", {}, "Parameters of the layers"), table(found.parameters, "parameters of the layers")),
      found.notes.length > 0 && h("details", { open: true }, h("summary", {}, "Notes and advice"), h("ul", {}, found.notes.map(note => h("li", {}, note)))),
      found.not_identifiable.length > 0 && h("p", { class: "soft" }, `Not identifiable from these recordings: ${found.not_identifiable.join(", ")}.`),
      this.frame("Report", `${found.folder}/report.html`));
  }

  // A result page in a frame without access to this one; loaded when it is opened.
  frame(title, path) {
    const box = h("details", { class: "report" }, h("summary", {}, title));
    box.addEventListener("toggle", () => {
      if (box.open && !box.querySelector("iframe")) box.append(h("iframe", { title, src: `file/${path}`, sandbox: "allow-scripts allow-downloads" }));
    });
    return box;
  }

  async paintCurves() {
    const { state, file } = this.app, found = state.diagnosis;
    this.chartBox.hidden = !file;
    if (!file) return;
    const on = (found?.causes || []).map(cause => cause.id).filter(id => !this.off.has(id));
    const { curves, summary } = await call("causes", { file, causes: on });
    this.chartBox.hidden = false;
    this.chart.set({ x: curves.time_s, curves: curves.forces.map(force => ({ name: force.name, y: force.force_n, ...CURVES[force.role] })) });
    this.chart.reading.textContent = `${file}: ${summary}`;
  }

  paintNext() {
    const { state } = this.app, busy = state.job?.state === "running";
    const inputs = LIMITS.map(([name, label, unit]) => h("label", { class: "limit" }, h("span", {}, label), h("input", { type: "text", inputmode: "decimal", name, value: String(state.limits[name]), size: "6" }), h("span", { class: "unit" }, unit)));
    const form = h("form", { onsubmit: event => { event.preventDefault(); this.plan(form); } }, inputs,
      h("div", { class: "row" }, h("button", { type: "submit", disabled: busy }, "Plan the next insertion")));
    const { plan, prediction } = state;
    const further = h("div", { class: "row" }, state.files.map(file => button(file, () => this.begin("predict", { files: [file] }), { disabled: busy, "aria-label": `Predict ${file}` })));
    fill(this.next,
      h("section", { class: "card" }, h("h2", {}, "What would separate the causes?"), form,
        plan && h("div", {}, h("p", {}, plan.summary), h("ol", { class: "segments" }, plan.segments.map(segment => h("li", {}, segment))),
          plan.pairs.length > 0 && table({ head: ["candidate", "or", "nats now", "then"], rows: plan.pairs }, "pairs of candidates"),
          h("div", { class: "row" }, button("See it on the phantom", () => this.app.attempt(async () => {
            this.app.views.phantom.along = null;
            await call("edit", { edit: { kind: "from_plan" } });
            await this.app.show("phantom", await call("state"));
          }))), this.frame("Plan", `${plan.folder}/plan.html`))),
      h("section", { class: "card" }, h("h2", {}, "Does it predict the next recording?"),
        h("p", { class: "soft" }, `Drop the recording of the next insertion${state.files.length > 0 ? ", then choose it" : ""}.`), state.files.length > 0 && further,
        prediction && h("div", {}, h("p", {}, prediction.sentence),
          table({ head: ["recording", "RMS N", "assumed", "in band"], rows: prediction.rows }, "prediction"), this.frame("Prediction", `${prediction.folder}/report.html`))));
  }

  plan(form) {
    const limits = {};
    for (const [name] of LIMITS) limits[name] = Number(form.elements[name].value.replace(",", "."));
    if (Object.values(limits).some(Number.isNaN)) { this.app.alert("Every limit is a number, such as 12.5."); return; }
    this.begin("plan", { files: this.files(), limits });
  }
}
