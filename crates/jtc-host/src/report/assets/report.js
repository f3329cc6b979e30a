// Script of the page. The script unpacks the data, draws the plots, and synchronises the time axes and cursors of the
// plots.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const root = document.documentElement;
  const J = [0, 1, 2, 3, 4, 5];

  // --- small helpers -------------------------------------------------------------------------------------------------
  const make = (tag, attributes = {}, ...children) => {
    const e = document.createElement(tag);
    for (const [k, v] of Object.entries(attributes)) k === "style" ? (e.style.cssText = v) : k === "on" ? e.addEventListener("click", v) : e.setAttribute(k, v);
    e.append(...children);
    return e;
  };
  const colours = new Map();
  const colour = (name) => {
    if (!colours.has(name)) colours.set(name, getComputedStyle(root).getPropertyValue(name).trim());
    return colours.get(name);
  };
  const known = (v) => v !== null && v !== undefined && Number.isFinite(v);
  const round = (v, digits) => (known(v) ? v.toFixed(digits).replace("-", "−") : "–");

  // --- data ----------------------------------------------------------------------------------------------------------
  const raw = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const unpack = (p) => {
    if (!p) return null;
    if (p.k === "c") return new Array(time.length).fill(p.v);
    if (p.k === "f32") return Array.from(new Float32Array(raw(p.d)), (v) => (Number.isNaN(v) ? null : v));
    return Array.from(new Int16Array(raw(p.d)), (v) => (v === -32768 ? null : p.o + v * p.s));
  };
  let time = [];
  time = unpack(data.time_s) || [];
  const column = {};
  for (const [k, v] of Object.entries(data)) {
    if (Array.isArray(v) && v.length === 6 && /_(rad|rad_s|rad_s2|nm|c|mrad)$/.test(k)) column[k] = v.map(unpack);
  }
  const last = time.length ? time[time.length - 1] : 1;
  const has = (name) => column[name] && column[name].some(Boolean);
  const names = data.joints.map((j, i) => j.name.replace(/^joint_(\d)$/, "Joint $1") || `Joint ${i + 1}`);
  const shown = J.map(() => true);
  // Binding limits of a motion that was planned but not executed. Such a motion has no measured values.
  const plan = data.plan;

  // --- heading -------------------------------------------------------------------------------------------------------
  const summary = data.summary;
  const best = (figure) => summary.joints.map((j, i) => [j[figure], i]).filter(([v]) => known(v)).sort((a, b) => b[0] - a[0])[0] || [null, 0];
  $("eyebrow").textContent = [data.arm, data.source, data.commanded_by].filter(Boolean).join(" · ");
  $("title").textContent = data.trajectory || "Recorded run";
  const when = data.start_unix_ms ? new Date(data.start_unix_ms).toLocaleString() + " · " : "";
  $("lede").textContent = `${when}${round(last, 2)} s ${plan ? "planned" : "recorded"}, ${data.samples.toLocaleString("en")} ${plan ? "points" : "samples"}` +
    (data.thinned > 1 ? `; the plots show the extremes of each group of ${data.thinned} samples.` : ".");
  const tile = (value, unit, text) => $("tiles").append(make("div", { class: "tile" }, make("b", {}, value, make("small", {}, unit)), make("span", {}, text)));
  const [rms, rmsJoint] = best("rms_error_mrad");
  const [max, maxJoint] = best("max_error_mrad");
  const [share, shareJoint] = best("torque_share");
  // The figures of a failed run do not show the quality of its tracking, so the page shows them only in the table below.
  const failed = known(data.failure_s);
  if (!failed && known(rms)) tile(round(rms, 2), "mrad", `worst RMS error, ${names[rmsJoint].toLowerCase()}`);
  if (!failed && known(max)) tile(round(max, 2), "mrad", `largest error, ${names[maxJoint].toLowerCase()}`);
  if (known(share)) tile(round(share * 100, 0), "%", `peak torque of limit, ${names[shareJoint].toLowerCase()}`);
  if (plan) {
    const seconds = J.map((j) => plan.filter((b) => b.joint === j + 1).reduce((all, b) => all + b.to_s - b.from_s, 0));
    const most = Math.max(...seconds);
    if (most > 0) tile(round(most / last * 100, 0), "%", `of the time ${names[seconds.indexOf(most)].toLowerCase()} is at a limit`);
  }
  tile(round(summary.executed_s || last, 2), "s", failed ? "executed before the failure" : summary.executed_s ? "of motion" : "recorded");

  // --- plots ---------------------------------------------------------------------------------------------------------
  const plots = [];
  const sync = uPlot.sync("time");
  let zooming = false;
  const zoom = (min, max) => {
    if (zooming) return;
    zooming = true;
    for (const { u } of plots) u.setScale("x", { min, max });
    zooming = false;
  };
  const axis = (more) => ({
    stroke: () => colour("--soft"), font: "12px system-ui, sans-serif",
    grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { show: false }, ...more,
  });

  // Returns a number on an axis as text. The number has enough digits to differ from the next number on the axis.
  const label = (v, step, digits) => {
    const needed = Math.ceil(-Math.log10(step || 1));
    return String(+v.toFixed(Math.min(Math.max(digits, needed), 20))).replace("-", "−");
  };

  // Draws a line at the time of the failure in a plot.
  const failureLine = (u) => {
    const { ctx, bbox } = u;
    const x = u.valToPos(data.failure_s, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.save();
    ctx.strokeStyle = colour("--warn");
    ctx.lineWidth = 2 * (devicePixelRatio || 1);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  };

  // Creates a plot. Each of the `lines` is {y, joint, kind, stroke, width, dash}. A line is visible if its joint and its kind are visible.
  const plot = (host, lines, { height = 250, unit = "", draw, range, digits = 3, axisless = false, onCursor } = {}) => {
    const kinds = {};
    lines = lines.filter((l) => l.y);
    const item = { lines, kinds, host, height };
    item.u = new uPlot({
      width: Math.max(host.clientWidth, 200), height,
      legend: { show: false },
      padding: [10, 12, 0, 0],
      cursor: {
        y: false, sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false },
        points: { size: 6, fill: (u, i) => u.series[i].stroke(u, i), width: 0 },
      },
      scales: { x: { time: false }, y: range ? { range } : {} },
      axes: [
        axis({ size: 30, space: 90, values: (u, ticks, i, space, step) => ticks.map((t) => `${label(t, step, 3)} s`), show: !axisless }),
        axis({ size: 52, values: (u, ticks, i, space, step) => ticks.map((t) => label(t, step, 6)), show: !axisless || !!lines.length }),
      ],
      series: [{}, ...lines.map((l) => ({
        stroke: () => colour(l.stroke), width: l.width || 1.4, dash: l.dash, points: { show: false }, show: true, alpha: l.alpha ?? 1,
      }))],
      hooks: {
        setScale: [(u, key) => key === "x" && known(u.scales.x.min) && zoom(u.scales.x.min, u.scales.x.max)],
        setCursor: [(u) => onCursor && onCursor(u.cursor.idx ?? null)],
        draw: [...(draw ? [draw] : []), ...(failed ? [failureLine] : [])],
      },
    }, [time, ...lines.map((l) => l.y)], host);
    plots.push(item);
    return item;
  };
  const refresh = () => plots.forEach(({ u, lines, kinds }) => {
    u.batch(() => lines.forEach((l, i) => {
      const show = (l.joint === undefined || shown[l.joint]) && kinds[l.kind] !== false;
      if (u.series[i + 1].show !== show) u.setSeries(i + 1, { show });
    }));
  });

  // Creates a card with a heading, with keys that show or hide kinds of lines, and with the values at the cursor.
  const card = (parent, heading, small) => {
    const keys = make("div", { class: "keys" });
    const readout = make("div", { class: "readout" });
    const body = make("div");
    const e = make("section", { class: "card" }, make("header", {}, make("h2", {}, heading, make("small", {}, small)), keys, readout), body);
    parent.append(e);
    return { e, keys, readout, body };
  };
  const key = (host, text, stroke, style, toggle) => {
    const b = make("button", { class: `key ${style}`, style: `--c: var(${stroke})`, "aria-pressed": "true" }, make("i"), text);
    b.addEventListener("click", () => {
      const off = b.classList.toggle("off");
      b.setAttribute("aria-pressed", String(!off));
      toggle(!off);
      refresh();
    });
    host.append(b);
  };
  const readouts = (host, y, digits) => (idx) => {
    host.replaceChildren(...(idx === null ? [] : J.filter((j) => shown[j] && y[j]).map((j) =>
      make("span", {}, make("i", { style: `--c: var(--j${j})` }), round(y[j][idx], digits)))));
  };

  const main = $("main");
  const stateNames = ["Start", "Init", "HoldPos", "Operate", "Teaching", "Error"];
  const tesNames = ["no trajectory", "Stop", "Pause", "Execute", "Finish"];

  // Draws a band. If the text fits into the band, the text is drawn on the band.
  const band = (u, from, to, y, h, fill, alpha, text, ink) => {
    const { ctx } = u;
    const { left, width } = u.bbox;
    const ratio = devicePixelRatio || 1;
    const a = Math.max(u.valToPos(from, "x", true), left - 20);
    const b = Math.min(u.valToPos(to, "x", true), left + width + 20);
    if (b < left || a > left + width || b <= a) return;
    ctx.fillStyle = fill;
    ctx.globalAlpha = alpha;
    ctx.beginPath();
    ctx.roundRect(a, y, Math.max(b - a - ratio, ratio), h, 3 * ratio);
    ctx.fill();
    ctx.globalAlpha = 1;
    ctx.font = `600 ${11.5 * ratio}px system-ui, sans-serif`;
    const x = Math.max(a, left) + 8 * ratio;
    if (text && x + ctx.measureText(text).width + 8 * ratio < Math.min(b, left + width)) {
      ctx.fillStyle = ink;
      ctx.textBaseline = "middle";
      ctx.textAlign = "left";
      ctx.fillText(text, x, y + h / 2 + ratio);
    }
  };

  // Binding limits of a plan. Each joint has a row on the common time axis.
  const limitColours = { velocity: "--st3", acceleration: "--st2", jerk: "--st4", torque: "--st5", stop: "--friction", friction: "--friction", "given time": "--st1" };
  if (plan && time.length) {
    const c = card(main, "Limits over time", "the joint that is at a limit, and the kind of limit");
    const rows = (u) => {
      const { ctx } = u;
      const ratio = devicePixelRatio || 1;
      const { left, top, width, height } = u.bbox;
      const h = height / 6;
      ctx.save();
      J.forEach((j) => {
        ctx.fillStyle = colour(`--j${j}`);
        ctx.globalAlpha = shown[j] ? 1 : 0.25;
        ctx.font = `600 ${12 * ratio}px system-ui, sans-serif`;
        ctx.textBaseline = "middle";
        ctx.textAlign = "right";
        ctx.fillText(String(j + 1), left - 10 * ratio, top + (j + 0.5) * h);
        ctx.globalAlpha = 1;
      });
      ctx.beginPath();
      ctx.rect(left, top, width, height);
      ctx.clip();
      J.forEach((j) => {
        ctx.fillStyle = colour("--grid");
        ctx.fillRect(left, top + (j + 1) * h - ratio, width, ratio);
      });
      for (const b of plan) {
        const j = b.joint - 1;
        if (shown[j]) band(u, b.from_s, b.to_s, top + j * h + 2 * ratio, h - 4 * ratio, colour(limitColours[b.limit] || "--st0"), 1, b.limit, "#fff");
      }
      ctx.restore();
    };
    const at = (idx) => {
      const t = idx === null ? null : time[idx];
      const now = t === null ? [] : plan.filter((b) => shown[b.joint - 1] && b.from_s <= t && t <= b.to_s);
      c.readout.replaceChildren(...now.map((b) => make("span", {}, make("i", { style: `--c: var(--j${b.joint - 1})` }), b.limit)));
    };
    const item = plot(c.body, [{ y: time.map(() => null), stroke: "--ink" }], { height: 6 * 24 + 40, draw: rows, range: [0, 1], onCursor: at });
    item.u.axes[1].values = () => [];
    item.u.axes[1].grid.show = false;
    for (const limit of [...new Set(plan.map((b) => b.limit))].sort()) {
      c.keys.append(make("span", { class: "key block", style: `--c: var(${limitColours[limit] || "--st0"})` }, make("i"), limit));
    }
    if (!plan.length) c.keys.append(make("span", { class: "key" }, "no joint is at a limit"));
  }

  // Timeline of states, with two rows of bands on the common time axis.
  if (time.length && !plan) {
    const c = card(main, "States", "controller, trajectory");
    const start = data.time_start_s;
    const bands = (u) => {
      const ctx = u.ctx;
      const ratio = devicePixelRatio || 1;
      const { left, top, width, height } = u.bbox;
      ctx.save();
      ctx.beginPath();
      ctx.rect(left, top, width, height);
      ctx.clip();
      [[data.states, stateNames, (v) => `--st${v}`], [data.tes, tesNames, (v) => `--st${[0, 1, 4, 3, 2][v] ?? 0}`]].forEach(([runs, words, style], row) => {
        const h = height / 2 - 3 * ratio;
        const y = top + row * (height / 2) + 1.5 * ratio;
        for (const [from, to, value] of runs) {
          band(u, from - start, to - start, y, h, colour(style(value)), row ? 0.55 : 1, words[value] ?? `state ${value}`, row ? colour("--ink") : "#fff");
        }
      });
      ctx.restore();
    };
    const item = plot(c.body, [{ y: time.map(() => null), stroke: "--ink" }], { height: 92, draw: bands, range: [0, 1] });
    item.u.axes[1].values = () => [];
    item.u.axes[1].grid.show = false;
    c.readout.textContent = data.errors.some((r) => r[2]) ? "errors occurred" : "";
  }

  // Draws the limits of the visible joints that are inside the plot. A limit that several joints have is drawn once, in a separate colour.
  const limits = (of) => (u) => {
    if (!of) return;
    const { ctx, bbox } = u;
    const all = new Map();
    J.filter((j) => shown[j]).forEach((j) => of(data.joints[j]).filter(known).forEach((v) => all.set(v, all.has(v) ? "--warn" : `--j${j}`)));
    ctx.save();
    ctx.lineWidth = devicePixelRatio || 1;
    ctx.setLineDash([6, 5]);
    for (const [v, stroke] of all) {
      if (v > u.scales.y.max || v < u.scales.y.min) continue;
      const y = u.valToPos(v, "y", true);
      ctx.strokeStyle = colour(stroke);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.restore();
  };
  const jointPlot = (heading, small, measured, set, options) => {
    if (!has(measured) && !(set && has(set))) return;
    const c = card(main, heading, small);
    const both = has(measured) && set && has(set);
    // Commanded values are broad pale bands, and measured values are fine lines on these bands. Equal values are therefore both visible.
    const lines = set && has(set) ? J.map((j) => ({ y: column[set][j], joint: j, kind: "set", stroke: `--j${j}`, ...(both ? { width: 5, alpha: 0.26 } : { width: 1.6 }) })) : [];
    if (has(measured)) lines.push(...J.map((j) => ({ y: column[measured][j], joint: j, kind: "measured", stroke: `--j${j}`, width: 1.4 })));
    const item = plot(c.body, lines, { ...options, draw: limits(options.limits), onCursor: readouts(c.readout, column[has(measured) ? measured : set], options.digits) });
    const { min, max } = item.u.scales.y;
    if (options.limits && data.joints.some((j) => options.limits(j).some((v) => known(v) && v >= min && v <= max))) {
      c.e.querySelector("small").append("; dashed: limits");
    }
    if (both) {
      key(c.keys, "measured", "--soft", "", (on) => { item.kinds.measured = on; });
      key(c.keys, "commanded", "--soft", "broad", (on) => { item.kinds.set = on; });
    }
  };
  jointPlot("Position", "rad", "position_rad", "set_position_rad", { digits: 4, height: 300, limits: (j) => [j.position_min_rad, j.position_max_rad] });
  jointPlot("Tracking error", "mrad, commanded − measured", "error_mrad", null, { digits: 3, height: 240 });
  jointPlot("Velocity", "rad/s", "velocity_rad_s", "set_velocity_rad_s", { digits: 3, height: 260, limits: (j) => [j.velocity_max_rad_s, -j.velocity_max_rad_s] });
  jointPlot("Acceleration", "rad/s²", "acceleration_rad_s2", "set_acceleration_rad_s2", { digits: 2, height: 240 });

  // Parts of the torque, with one small plot for each joint.
  if (has("torque_nm")) {
    const split = has("torque_model_nm");
    const parts = [
      // The total torque contains the noise of the feedback, so it is drawn behind its parts.
      [split ? "total" : "torque", "torque_nm", "--total", 1, split && !plan ? 0.4 : 1], ["feedback (PID)", "torque_pid_nm", "--pid", 1, 0.8],
      ["friction", "torque_friction_nm", "--friction", 1.5, 1], ["model", "torque_model_nm", "--model", 1.5, 1],
    ].filter(([, name]) => has(name));
    const keys = make("div", { class: "keys" });
    main.append(make("div", { class: "section" }, make("h2", {}, "Torque", make("small", {}, "N·m, with its parts; bars: peak as a share of the limit")), keys));
    const grid = make("div", { class: "grid3" });
    main.append(grid);
    let toLimit = false;
    const items = J.filter((j) => column.torque_nm[j]).map((j) => {
      const limit = data.joints[j].torque_max_nm;
      const s = summary.joints[j];
      const text = make("span", { class: "share" });
      const atRest = known(s.torque_share) ? `${round(s.peak_torque_nm, 1)} of ${round(limit, 0)} N·m` : `${round(s.peak_torque_nm, 1)} N·m`;
      text.textContent = atRest;
      const body = make("div");
      const e = make("section", { class: "card" }, make("header", {}, make("h3", {}, names[j]), text),
        make("div", { class: "gauge" }, make("i", { style: `--c: var(--j${j}); width: ${Math.min(100, (s.torque_share || 0) * 100)}%` })), body);
      grid.append(e);
      const limits = (u) => {
        if (!known(limit)) return;
        const { ctx, bbox } = u;
        ctx.save();
        ctx.strokeStyle = colour("--warn");
        ctx.lineWidth = devicePixelRatio || 1;
        ctx.setLineDash([6, 5]);
        for (const v of [limit, -limit]) {
          if (v > u.scales.y.max || v < u.scales.y.min) continue;
          const y = u.valToPos(v, "y", true);
          ctx.beginPath();
          ctx.moveTo(bbox.left, y);
          ctx.lineTo(bbox.left + bbox.width, y);
          ctx.stroke();
        }
        ctx.restore();
      };
      const item = plot(body, parts.map(([kind, name, stroke, width, alpha]) => ({ y: column[name][j], kind, stroke, width, alpha })), {
        height: 190, draw: limits,
        range: (u, min, max) => (toLimit && known(limit) ? [-limit * 1.08, limit * 1.08] : max - min < 0.1 ? [min - 1, max + 1] : uPlot.rangeNum(min ?? -1, max ?? 1, 0.1, true)),
        onCursor: (idx) => { text.textContent = idx === null ? atRest : `${round(column.torque_nm[j][idx], 2)} N·m`; },
      });
      item.card = e;
      item.joint = j;
      return item;
    });
    for (const [kind, , stroke] of parts) if (parts.length > 1) key(keys, kind, stroke, "", (on) => items.forEach((i) => { i.kinds[kind] = on; }));
    const button = make("button", { class: "plain", on: () => {
      toLimit = !toLimit;
      button.textContent = toLimit ? "Scale to the torques" : "Scale to the limits";
      items.forEach(({ u }) => u.setData(u.data, false) || u.setScale("x", { ...u.scales.x }) || u.redraw(true, true));
    } }, "Scale to the limits");
    if (data.joints.some((j) => known(j.torque_max_nm))) keys.append(button);
    var torqueGrid = { grid, items };
  }
  jointPlot("Temperature", "°C, bearing", "temperature_c", null, {
    digits: 1, height: 170, range: (u, min, max) => (max - min < 4 ? [Math.floor(min) - 2, Math.ceil(max) + 2] : uPlot.rangeNum(min, max, 0.1, true)),
  });

  // --- tables --------------------------------------------------------------------------------------------------------
  const table = (heading, head, rows) => make("section", { class: "card" }, make("header", {}, make("h2", {}, heading)),
    make("div", { class: "scroll" }, make("table", {}, ...(head ? [make("tr", {}, ...head.map((h) => make("th", {}, h)))] : []),
      ...rows.map((r) => make("tr", {}, ...r.map((cell) => (cell instanceof Node ? cell : make("td", {}, cell))))))));
  // A figure that no joint has does not get a column.
  const figures = [
    ["RMS error, mrad", "rms_error_mrad", 3], ["max error, mrad", "max_error_mrad", 3], ["peak speed, rad/s", "peak_velocity_rad_s", 3],
    ["peak torque, N·m", "peak_torque_nm", 2], ["limit, N·m", "torque_limit_nm", 1], ["share of limit", "torque_share"], ["hottest, °C", "peak_temperature_c", 0],
  ].filter(([, name]) => summary.joints.some((s) => known(s[name])));
  main.append(table(failed ? "Figures until the failure" : "Figures", ["Joint", ...figures.map(([head]) => head)],
    summary.joints.map((s, j) => [
      make("td", {}, make("i", { class: "dot", style: `--c: var(--j${j})` }), names[j]),
      ...figures.map(([, name, digits]) => name !== "torque_share" ? round(s[name], digits) : known(s.torque_share) ? make("td", s.torque_share > 1 ? { class: "over" } : {}, `${round(s.torque_share * 100, 0)} %`,
        make("span", { class: "gauge" }, make("i", { style: `--c: var(--j${j}); width: ${Math.min(100, s.torque_share * 100)}%` }))) : "–"),
    ])));
  const tables = make("div", { class: "tables" });
  for (const f of data.facts) tables.append(table(f.title, null, f.rows));
  main.append(tables);
  $("footer").textContent = `Made by openjtc ${data.version}. This page needs no network; plots by uPlot 1.6.32 (MIT).`;

  // --- joints shown, theme, zoom -------------------------------------------------------------------------------------
  const chips = J.map((j) => {
    const b = make("button", { class: "chip", style: `--c: var(--j${j})`, title: "click: show or hide · double-click: only this joint", "aria-pressed": "true" }, make("i"), names[j]);
    b.addEventListener("click", () => { shown[j] = !shown[j]; select(); });
    b.addEventListener("dblclick", () => { const alone = J.every((i) => shown[i] === (i === j)); J.forEach((i) => { shown[i] = alone || i === j; }); select(); });
    $("joints").append(b);
    return b;
  });
  const select = () => {
    if (!shown.some(Boolean)) shown.fill(true);
    chips.forEach((b, j) => { b.classList.toggle("off", !shown[j]); b.setAttribute("aria-pressed", String(shown[j])); });
    if (torqueGrid) {
      const count = shown.filter(Boolean).length;
      torqueGrid.grid.className = `grid3 ${count === 1 ? "one" : count === 2 || count === 4 ? "few" : ""}`;
      torqueGrid.items.forEach((i) => { i.card.hidden = !shown[i.joint]; i.card.style.display = shown[i.joint] ? "" : "none"; });
    }
    refresh();
    fit();
  };
  const fit = () => plots.forEach(({ u, host, height }) => {
    if (host.clientWidth && host.clientWidth !== u.width) u.setSize({ width: host.clientWidth, height });
  });
  let waiting = 0;
  addEventListener("resize", () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(() => { fit(); view && view.draw(); }); });
  const all = () => zoom(0, last);
  $("reset").addEventListener("click", all);
  const setTheme = (dark) => {
    root.classList.toggle("dark", dark);
    colours.clear();
    plots.forEach(({ u }) => u.redraw(false));
    view && view.draw();
  };
  $("theme").addEventListener("click", () => setTheme(!root.classList.contains("dark")));

  // --- the arm -------------------------------------------------------------------------------------------------------
  let view = null;
  // A joint that is no longer measured is drawn at its last measured position.
  const held = (y) => { let seen = 0; return y && y.map((v) => (known(v) ? (seen = v) : seen)); };
  const poses = (has("position_rad") ? column.position_rad : column.set_position_rad)?.map(held);
  const origins = data.joints.map((j) => j.origin);
  if (time.length && poses && poses.every(Boolean) && origins.some((o) => o.some((v) => v))) {
    const forward = Arm.chain(origins, data.flange);
    const at = (i) => J.map((j) => poses[j][i]);
    const step = Math.max(1, Math.floor(time.length / 700));
    const path = [];
    const extent = { across: 0.3, up: 0.3 };
    for (let i = 0; i < time.length; i += step) {
      const points = forward(at(i));
      path.push(points[7]);
      for (const [x, y, z] of points) {
        extent.across = Math.max(extent.across, Math.hypot(x, y));
        extent.up = Math.max(extent.up, z);
      }
    }
    view = new Arm.View($("arm"), forward, path, extent, colour);
    let playing = null;
    const show = (t) => {
      let lo = 0, hi = time.length - 1;
      while (lo < hi) { const mid = (lo + hi) >> 1; time[mid] < t ? (lo = mid + 1) : (hi = mid); }
      view.pose = at(lo);
      view.share = lo / Math.max(1, time.length - 1);
      view.draw();
      $("clock").textContent = `${time[lo].toFixed(2)} s`;
      $("scrub").value = String((time[lo] / last) * 1000);
      return lo;
    };
    const cursorTo = (t) => plots.forEach(({ u }) => u.setCursor({ left: u.valToPos(t, "x"), top: 10 }, false));
    const stop = () => { playing = null; $("play").textContent = "▶"; };
    $("scrub").addEventListener("input", (e) => { stop(); show((e.target.value / 1000) * last); });
    $("play").addEventListener("click", () => {
      if (playing) return stop();
      const value = Number($("scrub").value);
      playing = { from: performance.now(), at: value >= 999 ? 0 : (value / 1000) * last };
      $("play").textContent = "❚❚";
      const frame = (now) => {
        if (!playing) return;
        const t = playing.at + (now - playing.from) / 1000;
        show(Math.min(t, last));
        cursorTo(Math.min(t, last));
        t >= last ? stop() : requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    });
    plots.forEach(({ u }) => u.over.addEventListener("mousemove", () => {
      if (!playing && known(u.cursor.idx)) show(time[u.cursor.idx]);
    }));
    show(Number((location.hash.match(/t=([\d.]+)/) || [])[1] || last * 0.4));
  } else {
    document.querySelector(".stage").remove();
    document.querySelector(".hero").style.gridTemplateColumns = "1fr";
  }
  setTheme(/dark/.test(location.hash) || (!/light/.test(location.hash) && matchMedia("(prefers-color-scheme: dark)").matches));
  select();
})();
