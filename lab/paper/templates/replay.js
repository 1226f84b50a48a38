"use strict";
// Scrubs and plays the runs that the page embeds. A frame is a row of states; nothing is interpolated.
(function () {
  const runs = JSON.parse(document.getElementById("runs").textContent);
  const get = (id) => document.getElementById(id);
  const SVG = "http://www.w3.org/2000/svg";
  const MIDDLE = 400, FLOOR = 160, EDGE = 10, NEAR = 60; // px: the origin, the floor, the walls, the shortest spring
  const COLORS = { left: "#0072b2", object: "#333333", right: "#d55e00" };
  const ARROW = 110; // px of the largest force
  const SLOW = 0.04; // of the speed, in a contact
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)"), STILL = 1; // s between two pictures if so
  const LEFT_EDGE = 70, WIDTH = 715, TOP = 12, BOTTOM = 112; // px of the plot of V_c
  let table = null, run = null, frame = 0, clock = 0, shown = 0, last = null, playing = false, shapes = {}, largest = {};

  function decode(each) {
    const numbers = new Float32Array(Uint8Array.from(atob(each.data), (c) => c.charCodeAt(0)).buffer);
    return Object.fromEntries(each.columns.map((name, place) => [name, numbers.subarray(place * each.rows, (place + 1) * each.rows)]));
  }
  const value = (row, name) => table[name][row];

  function add(parent, tag, attributes) {
    const node = document.createElementNS(SVG, tag);
    for (const [name, text] of Object.entries(attributes)) node.setAttribute(name, text);
    return parent.appendChild(node);
  }

  function arrow(parent, name, label) {
    const group = add(parent, "g", {});
    const line = add(group, "path", { class: `arrow ${name}` });
    const text = add(group, "text", { class: name, "text-anchor": "middle" });
    text.textContent = label;
    return { group, line, text };
  }

  function point(shape, x, y, length) {
    shape.group.style.display = Math.abs(length) < 1 ? "none" : "";
    const head = Math.sign(length) * Math.min(10, Math.abs(length)), tip = x + length;
    shape.line.setAttribute("d", `M${x} ${y}H${tip}M${tip - head} ${y - 6}L${tip} ${y}L${tip - head} ${y + 6}`);
    shape.text.setAttribute("x", x + length / 2);
    shape.text.setAttribute("y", y - 8);
  }

  function build() {
    const stage = get("stage");
    stage.replaceChildren();
    const largestRow = (name) => { let m = 0; for (let r = 0; r < run.rows; r++) m = Math.max(m, Math.abs(value(r, name))); return m; };
    largest = { f: Math.max(largestRow("f_l"), largestRow("f_r"), 1e-12), fw: Math.max(largestRow("fw_l"), largestRow("fw_r"), 1e-12) };
    const wide = Math.max(largestRow("x_l"), largestRow("x_r"), largestRow("x_o"));
    const sizes = run.masses.map((mass) => Math.min(36 * Math.cbrt(mass), 110));
    shapes = { scale: (MIDDLE - EDGE - NEAR - sizes[1] / 2 - Math.max(sizes[0], sizes[2])) / wide };
    add(stage, "path", { d: `M${EDGE} 40V${FLOOR}M${800 - EDGE} 40V${FLOOR}`, class: "wall" });
    add(stage, "path", { d: `M0 ${FLOOR}H800`, class: "mark" });
    add(stage, "path", { d: `M${MIDDLE} ${FLOOR}v8`, class: "mark" });
    add(stage, "text", { x: MIDDLE, y: FLOOR + 24, "text-anchor": "middle" }).textContent = "0";
    for (const mark of [-0.5, 0.5]) {
      const at = MIDDLE + mark * shapes.scale;
      add(stage, "path", { d: `M${at} ${FLOOR}v8`, class: "mark" });
      add(stage, "text", { x: at, y: FLOOR + 24, "text-anchor": "middle" }).textContent = `${mark} m`.replace("-", "\u2212");
    }
    ["left", "object", "right"].forEach((name, place) => {
      const size = sizes[place];
      shapes[name] = { size, body: add(stage, "rect", { id: `mass-${name}`, width: size, height: size, y: FLOOR - size, rx: 3, class: `body ${name}` }) };
      if (name !== "object") {
        shapes[name].spring = add(stage, "path", { class: `line ${name}` });
        shapes[name].damper = add(stage, "path", { class: `line ${name}` });
        shapes[name].input = arrow(stage, name, name === "left" ? "f_l" : "f_r");
        shapes[name].push = arrow(stage, "force", name === "left" ? "fw_l" : "fw_r");
        shapes[name].flash = add(stage, "circle", { r: 9, cy: FLOOR - 14, class: "line force", "stroke-width": 3 });
      }
    });
    shapes.note = add(stage, "text", { x: 8, y: 238 });
    shapes.note.textContent = `longest arrows: input ${largest.f.toPrecision(3)} N, impact ${largest.fw.toPrecision(3)} N`;
    buildEnergy();
  }

  function buildEnergy() {
    const plot = get("energy"), end = value(run.rows - 1, "t");
    plot.replaceChildren();
    shapes.time = (t) => LEFT_EDGE + WIDTH * t / end;
    run.contacts.forEach((spans, side) => spans.forEach(([a, b]) => add(plot, "rect", {
      x: shapes.time(a), width: Math.max(shapes.time(b) - shapes.time(a), 0.6), y: side ? 126 : 118, height: 7, fill: side ? COLORS.right : COLORS.left,
    })));
    const positive = Array.from(table.V_c).filter((v) => v > 0), high = Math.max(...positive);
    let top = Math.ceil(Math.log10(high)), foot = Math.max(Math.floor(Math.log10(Math.min(...positive))), top - 9);
    if (foot === top) { foot -= 1; top += 1; }
    const y = (v) => BOTTOM - (BOTTOM - TOP) * (Math.max(Math.log10(v), foot) - foot) / (top - foot);
    const each = Math.ceil((top - foot) / 3); // labels that fit
    for (let power = foot; power <= top; power += 1) {
      const at = y(10 ** power);
      add(plot, "path", { d: `M${LEFT_EDGE} ${at}h${WIDTH}`, class: "grid" });
      if ((top - power) % each === 0) {
        const label = add(plot, "text", { x: LEFT_EDGE - 6, y: at + 5, "text-anchor": "end" });
        label.textContent = "10";
        add(label, "tspan", { dy: "-0.4em", "font-size": "75%" }).textContent = String(power).replace("-", "\u2212");
      }
    }
    for (let t = 0; t <= end; t += 5) {
      add(plot, "path", { d: `M${shapes.time(t)} ${TOP}V${BOTTOM}`, class: "grid" });
      add(plot, "text", { x: shapes.time(t), y: 160, "text-anchor": t === 0 ? "start" : t === end ? "end" : "middle" }).textContent = t === end ? `${t} s` : `${t}`;
    }
    let d = "";
    for (let r = 0; r < run.rows; r++) d += `${r ? "L" : "M"}${shapes.time(value(r, "t")).toFixed(1)} ${y(value(r, "V_c")).toFixed(1)}`;
    add(plot, "path", { d, fill: "none", stroke: "currentColor", "stroke-width": 1.5 });
    add(plot, "text", { x: LEFT_EDGE + WIDTH - 6, y: TOP + 16, "text-anchor": "end" }).textContent = "V_c, J";
    shapes.cursor = add(plot, "path", { class: "force", "stroke-width": 2 });
  }

  function spring(from, to, y) {
    const turns = 12, step = (to - from) / turns;
    let d = `M${from} ${y}`;
    for (let k = 0; k < turns; k++) d += `L${from + (k + 0.5) * step} ${y + (k % 2 ? 7 : -7)}`;
    return `${d}L${to} ${y}`;
  }

  function damper(from, to, y) {
    const middle = from + (to - from) * 0.5, sign = Math.sign(to - from) || 1;
    return `M${from} ${y}H${middle}M${middle} ${y - 5}v10M${middle + 12 * sign} ${y - 8}H${middle - 12 * sign}v16H${middle + 12 * sign}M${middle + 2 * sign} ${y}H${to}`;
  }

  function draw() {
    const t = value(frame, "t"), px = (x) => MIDDLE + x * shapes.scale, half = shapes.object.size / 2;
    const x = { left: value(frame, "x_l"), object: value(frame, "x_o"), right: value(frame, "x_r") };
    shapes.object.body.setAttribute("x", px(x.object) - half);
    shapes.object.body.dataset.x = x.object;
    for (const name of ["left", "right"]) {
      const side = name === "left" ? -1 : 1, shape = shapes[name];
      const face = px(x[name]) + side * half, back = face + side * shape.size, wall = side < 0 ? EDGE : 800 - EDGE;
      shape.body.setAttribute("x", Math.min(face, back));
      shape.body.dataset.x = x[name];
      shape.spring.setAttribute("d", spring(wall, back, FLOOR - shape.size * 0.75));
      shape.damper.setAttribute("d", run.damped ? damper(wall, back, FLOOR - shape.size * 0.25) : "");
      point(shape.input, (face + back) / 2, FLOOR - shape.size - 12, ARROW * value(frame, side < 0 ? "f_l" : "f_r") / largest.f);
      const push = value(frame, side < 0 ? "fw_l" : "fw_r");
      const length = ARROW * push / largest.fw; // on the object, from outside
      point(shape.push, px(x.object) + side * (half + length), FLOOR + 46, -side * length);
      shape.flash.style.display = push > 0 ? "" : "none";
      shape.flash.setAttribute("cx", face);
    }
    shapes.cursor.setAttribute("d", `M${shapes.time(t)} ${TOP - 7}V134`);
    get("slider").value = frame;
    const show = (id, text) => { get(id).textContent = text.replace("-", "\u2212"); };
    show("now-t", t.toFixed(4));
    show("now-V_c", value(frame, "V_c").toPrecision(3));
    for (const name of ["x_l", "x_o", "x_r"]) show(`now-${name}`, (1e3 * value(frame, name)).toFixed(1));
    for (const name of ["f_l", "f_r", "fw_l", "fw_r"]) show(`now-${name}`, value(frame, name).toFixed(2));
  }

  function seek(row) {
    frame = Math.min(Math.max(row, 0), run.rows - 1);
    clock = value(frame, "t");
    draw();
  }

  function choose(place) {
    run = runs[place];
    table = decode(run);
    get("slider").max = run.rows - 1;
    build();
    seek(0);
  }

  function tick(now) {
    if (!playing) return;
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
    last = now;
    const touching = value(frame, "fw_l") > 0 || value(frame, "fw_r") > 0;
    clock += passed * Number(get("speed").value) * (get("slow").checked && touching ? SLOW : 1);
    while (frame < run.rows - 1 && value(frame + 1, "t") <= clock) frame += 1;
    const done = frame === run.rows - 1;
    if (!calm.matches || done || now - shown >= 1000 * STILL) { draw(); shown = now; }
    if (done) return stop();
    requestAnimationFrame(tick);
  }

  function stop() {
    playing = false;
    get("play").textContent = "play";
  }

  get("play").addEventListener("click", () => {
    if (playing) return stop();
    if (frame === run.rows - 1) seek(0);
    playing = true;
    last = null;
    get("play").textContent = "pause";
    requestAnimationFrame(tick);
  });
  get("back").addEventListener("click", () => { stop(); seek(frame - 1); });
  get("forth").addEventListener("click", () => { stop(); seek(frame + 1); });
  get("slider").addEventListener("input", (event) => { stop(); seek(Number(event.target.value)); });
  get("case").addEventListener("change", (event) => { stop(); choose(Number(event.target.value)); });
  get("energy").addEventListener("click", (event) => {
    const box = get("energy").getBoundingClientRect(), end = value(run.rows - 1, "t");
    const t = ((event.clientX - box.left) / box.width * 800 - LEFT_EDGE) / WIDTH * end;
    let row = 0;
    while (row < run.rows - 1 && value(row + 1, "t") <= t) row += 1;
    stop();
    seek(row);
  });
  document.addEventListener("keydown", (event) => {
    const own = event.key === " " ? "input, select, button, summary, a, [tabindex]" : "input, select, [tabindex]"; // keys of theirs
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest(own)) return;
    const pressed = { " ": "play", ArrowLeft: "back", ArrowRight: "forth" }[event.key];
    if (!pressed) return;
    event.preventDefault();
    get(pressed).click();
  });
  document.querySelectorAll("input[name=view]").forEach((each) => each.addEventListener("change", () => {
    document.body.dataset.view = each.value;
    fit();
  }));
  const fit = () => document.querySelectorAll(".wide, figure, .said").forEach((each) => { // what scrolls is reached by keys
    const scrolls = each.scrollWidth > each.clientWidth || each.scrollHeight > each.clientHeight;
    if (scrolls) each.tabIndex = 0; else each.removeAttribute("tabindex");
  });
  fit();
  window.addEventListener("resize", fit);
  document.addEventListener("toggle", fit, true);
  choose(0);
})();
