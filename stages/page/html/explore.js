// The explorer of both pages: each run's curves, by joint or group of joints, from the data that the page holds.
"use strict";
(() => {
  const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const PANELS = [
    { curve: "reward", title: "Reward as paid (scaled units)" },
    { curve: "q_move", title: "Q(MOVE) / temperature" },
    { curve: "move_probability", title: "P(MOVE)", range: [0, 1] },
  ];
  const SIZE = { plot: 120, left: 52, right: 10, top: 34, bottom: 24 }; // pixels; phases' names are above the first panel

  const all = [...document.querySelectorAll("script.explored")].map((block) => JSON.parse(block.textContent));
  const form = document.getElementById("explorer");
  const choices = form.querySelector(".choices");
  const panels = document.getElementById("panels");
  const reading = document.getElementById("reading");
  const PREFERRED = { condition: "noisy", reward: "cais" }; // where there is such a cell
  let data = all[0]; // of the study that is shown; the paper's page has one
  let last = 0; // step
  let shown = []; // of each panel: its series and scales, as drawn
  let width = 0; // of the panels, as drawn

  // Data: a value is two digits, as stages/explore.py packs them, by seed, joint and block.

  const digit = new Uint8Array(128);
  [...DIGITS].forEach((letter, value) => { digit[letter.charCodeAt(0)] = value; });

  function value(packed, seed, joint, block) {
    const place = 2 * ((seed * data.joints.length + joint) * data.steps.length + block);
    const level = 64 * digit[packed.text.charCodeAt(place)] + digit[packed.text.charCodeAt(place + 1)];
    return packed.low + (level / data.levels) * (packed.high - packed.low);
  }

  const mean = (values) => values.reduce((sum, each) => sum + each, 0) / values.length;

  function sd(values) { // of seeds, n - 1; one seed has none
    const centre = mean(values);
    return values.length > 1 ? Math.sqrt(values.reduce((sum, each) => sum + (each - centre) ** 2, 0) / (values.length - 1)) : 0;
  }

  // What can be chosen: of a study its cells, part by part of their names.

  /** The value of a select that has these options, [value, text]: what it had, if that is among them, else `preferred`. */
  function select(name, title, options, preferred) {
    let made = form.elements[name];
    if (!made) {
      made = Object.assign(document.createElement("select"), { name });
      const label = document.createElement("label");
      label.append(`${title} `, made);
      choices.append(label);
    }
    const values = options.map(([each]) => each);
    if (values.join() !== [...made.options].map((option) => option.value).join()) {
      const chosen = [made.value, preferred, values[0]].find((each) => values.includes(each));
      made.replaceChildren(...options.map(([each, text]) => new Option(text, each, each === chosen, each === chosen)));
    }
    return made.value;
  }

  /** Selects that lead to a cell that there is; what was chosen stays where it can. */
  function offer() {
    if (all.length > 1) select("study", "Study", all.map(({ title }, place) => [String(place), title]));
    let above = "";
    for (const part of data.parts) {
      const names = Object.keys(data.cells).filter((name) => name.startsWith(above));
      const values = [...new Set(names.map((name) => name.slice(above.length).split("/")[0]))];
      const title = part[0].toUpperCase() + part.slice(1);
      above += `${select(part, title, values.map((each) => [each, data.labels[each] || each]), PREFERRED[part])}/`;
    }
    if (data.joints.length > 2) {
      const joints = data.joints.map((name, joint) => [String(joint), name.replaceAll("_", " ") + (data.attached[joint] ? ", attached" : "")]);
      select("joint", "Joint", [["groups", "attached limb and others"], ...joints]);
    }
  }

  /** What a study's data decide besides: seeds, steps. */
  function open() {
    data = all[Number(form.elements.study?.value || 0)];
    last = Math.max(...Object.values(data.phases).map(([, stop]) => stop));
    form.querySelector(".seeds").replaceChildren(...Array.from({ length: data.seeds }, (_, seed) => {
      const label = document.createElement("label");
      label.innerHTML = `<input type="checkbox" name="seed" value="${seed}" checked> ${(data.first || 0) + seed} `;
      return label;
    }));
    form.step.max = data.steps.length - 1;
    form.step.value = data.steps.filter((step) => step <= data.phases.attached[1]).length - 1;
  }

  // What is chosen.

  const cell = () => data.parts.map((part) => form.elements[part].value).join("/");

  function groups() {
    const every = data.joints.map((_, joint) => joint);
    const chosen = form.elements.joint?.value || "groups";
    if (chosen !== "groups") {
      const joint = Number(chosen);
      return [{ name: data.joints[joint].replace("_", " "), joints: [joint], dashed: !data.attached[joint] }];
    }
    return [
      { name: "attached limb", joints: every.filter((joint) => data.attached[joint]), dashed: false },
      { name: "other limbs", joints: every.filter((joint) => !data.attached[joint]), dashed: true },
    ];
  }

  const seeds = () => [...form.querySelectorAll("[name=seed]:checked")].map((box) => Number(box.value));

  /** For each group its name, each seed's line, and their mean and SD; a line has a value for each block. */
  function series(packed) {
    return groups().map(({ name, joints, dashed }) => {
      const lines = seeds().map((seed) =>
        data.steps.map((_, block) => mean(joints.map((joint) => value(packed, seed, joint, block)))));
      const across = (summary) => data.steps.map((_, block) => summary(lines.map((line) => line[block])));
      return { name, dashed, lines, mean: across(mean), sd: across(sd) };
    });
  }

  // Drawing.

  function element(name, attributes, ...children) {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    Object.entries(attributes).forEach(([key, text]) => made.setAttribute(key, text));
    made.append(...children);
    return made;
  }

  function extent(drawn, each) {
    const values = drawn.flatMap((one) => (each
      ? one.lines.flat()
      : one.mean.flatMap((centre, block) => [centre - one.sd[block], centre + one.sd[block]])));
    const low = Math.min(...values);
    const high = Math.max(...values);
    const room = (high - low) * 0.06 || 0.5;
    return [low - room, high + room];
  }

  /** Some four round numbers between two ends. */
  function ticks([low, high]) {
    const rough = (high - low) / 4;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= rough);
    const digits = Math.max(0, -Math.floor(Math.log10(step)));
    const first = Math.ceil(low / step);
    return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, count) => {
      const at = (first + count) * step;
      return { at, text: number(at, digits) };
    });
  }

  const number = (at, digits = 3) => at.toFixed(digits).replace(/^-(?=0(\.0*)?$)/, "").replace("-", "−");

  const phaseOf = (step) => Object.entries(data.phases).find(([, [first, stop]]) => first <= step && step <= stop)[0];

  /** A path over the blocks, broken where a phase ends. */
  function path(values, x, y) {
    return values.map((at, block) => {
      const begins = block === 0 || phaseOf(data.steps[block]) !== phaseOf(data.steps[block - 1]);
      return `${begins ? "M" : "L"}${x(data.steps[block]).toFixed(1)} ${y(at).toFixed(1)}`;
    }).join("");
  }

  /** The bands of 1 SD, one for each phase. */
  function bands({ mean: centre, sd: spread }, x, y) {
    return Object.values(data.phases).map(([first, stop]) => {
      const blocks = data.steps.map((_, block) => block).filter((block) => first <= data.steps[block] && data.steps[block] <= stop);
      const edge = (sign) => blocks.map((block) =>
        `${x(data.steps[block]).toFixed(1)} ${y(centre[block] + sign * spread[block]).toFixed(1)}`);
      return `M${[...edge(1), ...edge(-1).reverse()].join("L")}Z`;
    }).join("");
  }

  function panel({ curve, title, range }, index, packed, colour) {
    const first = index === 0;
    const top = first ? SIZE.top : SIZE.top - 14;
    const bottom = top + SIZE.plot;
    const drawn = series(packed[curve]);
    const each = form.each.checked;
    const ends = range || extent(drawn, each);
    const x = (step) => SIZE.left + ((step - 1) / (last - 1)) * (width - SIZE.left - SIZE.right);
    const y = (at) => bottom - ((at - ends[0]) / (ends[1] - ends[0])) * SIZE.plot;
    const svg = element("svg", { width, height: bottom + SIZE.bottom, role: "img", "aria-label": `${title} over agent steps` });
    for (const [name, [start, stop]] of Object.entries(data.phases)) {
      svg.append(element("rect", { x: x(start), y: top, width: x(stop) - x(start), height: SIZE.plot, class: name }));
      if (first) svg.append(element("text", { x: (x(start) + x(stop)) / 2, y: top - 5, "text-anchor": "middle" }, name));
      svg.append(element("text", { x: x(stop), y: bottom + 14, "text-anchor": "end" }, stop));
    }
    svg.append(element("text", { x: SIZE.left, y: 13, class: "title" }, title));
    for (const { at, text } of ticks(ends)) {
      svg.append(element("path", { d: `M${SIZE.left} ${y(at)}H${width - SIZE.right}`, class: "grid" }));
      svg.append(element("text", { x: SIZE.left - 6, y: y(at) + 4, "text-anchor": "end" }, text));
    }
    for (const one of drawn) {
      const dash = one.dashed ? "5 3" : "none";
      if (each) one.lines.forEach((line) => svg.append(element("path", { d: path(line, x, y), class: "seed", stroke: colour, "stroke-dasharray": dash })));
      else svg.append(element("path", { d: bands(one, x, y), class: "band", fill: colour }));
      svg.append(element("path", { d: path(one.mean, x, y), class: "mean", stroke: colour, "stroke-dasharray": dash }));
    }
    const cursor = element("g", { class: "cursor" });
    svg.append(cursor);
    panels.append(svg);
    return { drawn, x, y, top, bottom, cursor, colour };
  }

  function draw() {
    width = panels.clientWidth;
    if (!width) return; // not laid out, as in print
    panels.replaceChildren();
    shown = [];
    if (seeds().length) {
      const colour = data.colours[form.elements.reward.value];
      shown = PANELS.map((each, index) => panel(each, index, data.cells[cell()], colour));
    }
    read();
  }

  // Reading.

  function read() {
    const block = Number(form.step.value);
    const step = data.steps[block];
    form.step.setAttribute("aria-valuetext", `step ${step}, ${phaseOf(step)}`);
    if (!shown.length) {
      reading.textContent = "No seed is chosen.";
      return;
    }
    for (const { drawn, x, y, top, bottom, cursor, colour } of shown) {
      cursor.replaceChildren(element("path", { d: `M${x(step)} ${top}V${bottom}` }),
        ...drawn.map((one) => element("circle", { cx: x(step), cy: y(one.mean[block]), r: 3.5, fill: colour })));
    }
    const lines = shown[0].drawn.map(({ name, dashed }, place) => `${dashed ? "┄" : "—"} ${name}: ${shown.map(({ drawn }, index) => {
      const { mean: centre, sd: spread } = drawn[place];
      const around = seeds().length > 1 ? ` ± ${number(spread[block])}` : "";
      return `${PANELS[index].title.split(" (")[0]} ${number(centre[block])}${around}`;
    }).join(", ")}`);
    reading.textContent = [`Around step ${step} (${phaseOf(step)}), n = ${seeds().length}`, ...lines].join("\n");
  }

  function point(event) {
    const { x } = shown[0] || {};
    if (!x) return;
    const at = event.clientX - panels.getBoundingClientRect().left;
    const away = data.steps.map((step) => Math.abs(x(step) - at));
    form.step.value = away.indexOf(Math.min(...away));
    read();
  }

  form.addEventListener("change", ({ target }) => {
    if (target.name === "study") open();
    if (target.tagName === "SELECT") offer();
    if (target !== form.step) draw();
  });
  form.step.addEventListener("input", read);
  form.addEventListener("submit", (event) => event.preventDefault());
  for (const name of ["all", "none"]) {
    form[name].addEventListener("click", () => {
      form.querySelectorAll("[name=seed]").forEach((box) => { box.checked = name === "all"; });
      draw();
    });
  }
  panels.addEventListener("pointermove", point);
  panels.addEventListener("pointerdown", point);
  open();
  offer();
  form.hidden = false;
  new ResizeObserver(() => { if (panels.clientWidth !== width) draw(); }).observe(panels);
})();
