"use strict";
// Scrubs and plays the runs that the page embeds. A frame is a row of states; nothing is interpolated.
(function () {
  const runs = JSON.parse(document.getElementById("runs").textContent);
  const get = (id) => document.getElementById(id);
  const SVG = "http://www.w3.org/2000/svg";
  const MIDDLE = 400, FLOOR = 160, EDGE = 10, NEAR = 60; // px: the origin, the floor, the walls, the shortest spring
  const COLORS = { left: "#0072b2", object: "#333333", right: "#d55e00" };
  const ARROW = 110; // px of the largest force
  let table = null, run = null, frame = 0, clock = 0, last = null, playing = false, shapes = {}, largest = {};

  function decode(each) {
    const bytes = Uint8Array.from(atob(each.data), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }
  const value = (row, name) => table[row * run.columns.length + run.columns.indexOf(name)];

  function add(parent, tag, attributes) {
    const node = document.createElementNS(SVG, tag);
    for (const [name, text] of Object.entries(attributes)) node.setAttribute(name, text);
    return parent.appendChild(node);
  }

  function arrow(parent, color, label) {
    const group = add(parent, "g", {});
    const line = add(group, "path", { stroke: color, "stroke-width": 4, fill: "none" });
    const text = add(group, "text", { fill: color, "text-anchor": "middle" });
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
    add(stage, "path", { d: `M${EDGE} 40V${FLOOR}M${800 - EDGE} 40V${FLOOR}`, stroke: "#777", "stroke-width": 3 });
    add(stage, "path", { d: `M0 ${FLOOR}H800`, stroke: "#999" });
    add(stage, "path", { d: `M${MIDDLE} ${FLOOR}v8`, stroke: "#999" });
    add(stage, "text", { x: MIDDLE, y: FLOOR + 24, "text-anchor": "middle", fill: "#666" }).textContent = "0";
    for (const mark of [-0.5, 0.5]) {
      const at = MIDDLE + mark * shapes.scale;
      add(stage, "path", { d: `M${at} ${FLOOR}v8`, stroke: "#999" });
      add(stage, "text", { x: at, y: FLOOR + 24, "text-anchor": "middle", fill: "#666" }).textContent = `${mark} m`;
    }
    ["left", "object", "right"].forEach((name, place) => {
      const size = sizes[place];
      shapes[name] = { size, body: add(stage, "rect", { id: `mass-${name}`, width: size, height: size, y: FLOOR - size, rx: 3, fill: COLORS[name], "fill-opacity": 0.55, stroke: COLORS[name] }) };
      if (name !== "object") {
        shapes[name].spring = add(stage, "path", { fill: "none", stroke: COLORS[name], "stroke-width": 1.5 });
        shapes[name].damper = add(stage, "path", { fill: "none", stroke: COLORS[name], "stroke-width": 1.5 });
        shapes[name].input = arrow(stage, COLORS[name], name === "left" ? "f_l" : "f_r");
        shapes[name].push = arrow(stage, "#a8310b", name === "left" ? "fw_l" : "fw_r");
        shapes[name].flash = add(stage, "circle", { r: 9, cy: FLOOR - 14, fill: "none", stroke: "#a8310b", "stroke-width": 3 });
      }
    });
    shapes.note = add(stage, "text", { x: 8, y: 238, fill: "#555" });
    shapes.note.textContent = `longest arrows: input ${largest.f.toPrecision(3)} N, impact ${largest.fw.toPrecision(3)} N`;
    buildEnergy();
  }

  function buildEnergy() {
    const plot = get("energy"), end = value(run.rows - 1, "t");
    plot.replaceChildren();
    shapes.time = (t) => 50 + 740 * t / end;
    run.contacts.forEach((spans, side) => spans.forEach(([a, b]) => add(plot, "rect", {
      x: shapes.time(a), width: Math.max(shapes.time(b) - shapes.time(a), 0.6), y: side ? 116 : 108, height: 7, fill: side ? COLORS.right : COLORS.left,
    })));
    let low = Infinity, high = 0;
    for (let r = 0; r < run.rows; r++) { const v = value(r, "V_c"); if (v > 0) { low = Math.min(low, v); high = Math.max(high, v); } }
    low = Math.max(low, high * 1e-9);
    if (low > 0.5 * high) low = 0.5 * high;
    const y = (v) => 100 - 90 * Math.log(Math.max(v, low) / low) / Math.log(high / low);
    let d = "";
    for (let r = 0; r < run.rows; r++) d += `${r ? "L" : "M"}${shapes.time(value(r, "t")).toFixed(1)} ${y(value(r, "V_c")).toFixed(1)}`;
    add(plot, "path", { d, fill: "none", stroke: "#000", "stroke-width": 1.5 });
    add(plot, "text", { x: 4, y: 20 }).textContent = "V_c";
    add(plot, "text", { x: 50, y: 144 }).textContent = "0";
    add(plot, "text", { x: 790, y: 144, "text-anchor": "end" }).textContent = `${end.toFixed(0)} s`;
    shapes.cursor = add(plot, "path", { stroke: "#a8310b", "stroke-width": 2 });
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
    shapes.cursor.setAttribute("d", `M${shapes.time(t)} 5V126`);
    get("slider").value = frame;
    const mm = (v) => `${(1e3 * v).toFixed(2)}`;
    get("readout").textContent = `t ${t.toFixed(4)} s  x_l ${mm(x.left)}  x_o ${mm(x.object)}  x_r ${mm(x.right)} mm  ` +
      `fw ${value(frame, "fw_l").toFixed(2)}, ${value(frame, "fw_r").toFixed(2)} N  f ${value(frame, "f_l").toFixed(2)}, ${value(frame, "f_r").toFixed(2)} N  ` +
      `V_c ${value(frame, "V_c").toPrecision(3)} J`;
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
    clock += passed * Number(get("speed").value) * (get("slow").checked && touching ? 0.04 : 1);
    while (frame < run.rows - 1 && value(frame + 1, "t") <= clock) frame += 1;
    draw();
    if (frame === run.rows - 1) return stop();
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
    const t = ((event.clientX - box.left) / box.width * 800 - 50) / 740 * end;
    let row = 0;
    while (row < run.rows - 1 && value(row + 1, "t") <= t) row += 1;
    stop();
    seek(row);
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || /^(INPUT|SELECT|BUTTON|SUMMARY|A)$/.test(event.target.tagName)) return;
    const pressed = { " ": "play", ArrowLeft: "back", ArrowRight: "forth" }[event.key];
    if (!pressed) return;
    event.preventDefault();
    get(pressed).click();
  });
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => { each.open = true; }));
  choose(0);
})();
