/* The page's own logic: the stream of events into plots, words and the 3-D view; the sliders, while armed, into commands. */
"use strict";

const $ = (id) => document.getElementById(id);
const WINDOW_S = 30, LEAST_S = 10, REPEAT_MS = 200, SOON_MS = 40, STALE_MS = 1000;
const DIRECTION_FROM_DEG = 3; /* of less bend a direction is noise */
const INK = "#1d2733", COMMAND = "#b0489b", SUPPLY = "#5c6b7a";
const page = Array.from(crypto.getRandomValues(new Uint8Array(8)), (v) => v.toString(16).padStart(2, "0")).join("");
let token = "", geometry = null, scene = null, last = null, heardAt = 0, lastSent = 0, sending = false, soon = 0;
window.tribend = { events: 0, posts: 0, page };

/* --- requests --- */

async function post(path, body) {
  window.tribend.posts++;
  const answer = await fetch(path, { method: "POST", body: JSON.stringify({ page, ...body }),
    headers: { Authorization: "Bearer " + token, "Content-Type": "application/json" } });
  if (!answer.ok) throw new Error((await answer.json()).error);
}

function say(text) { $("notice").textContent = text; }

async function findToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    history.replaceState(null, "", location.pathname); /* out of sight, and out of the history */
    return given;
  }
  const answer = await (await fetch("session")).json();
  if (!answer.token) throw new Error(answer.error);
  return answer.token;
}

/* --- plots --- */

const series = { time: [], bend: [], bendTable: [], bendCommand: [], direction: [], directionTable: [], directionCommand: [] };
for (let c = 0; c < 3; c++) for (const name of ["pressure", "target", "duty"]) series[name + c] = [];

const line = (stroke, dashed, width) => ({ stroke, width: width || 1.8, dash: dashed ? [6, 4] : undefined, points: { show: false } });
const plots = [];

function plot(id, names, lines, range, unit, splits) {
  const place = $(id);
  const axis = { stroke: "#5c6b7a", font: "11px system-ui, 'DejaVu Sans', sans-serif", grid: { stroke: "#e9edf1", width: 1 }, ticks: { show: false } };
  const chart = new uPlot({
    width: place.clientWidth, height: 100, legend: { show: false }, cursor: { show: false }, padding: [6, 8, 0, 0],
    scales: { x: { time: false }, y: { range } },
    axes: [{ ...axis, size: 20, values: (u, ticks) => ticks.map((t) => t + " s") },
      { ...axis, size: 52, space: 22, ...(splits ? { splits: () => splits } : {}), values: (u, ticks) => ticks.map((t) => t + unit) }],
    series: [{}, ...lines],
  }, [series.time, ...names.map((n) => series[n])], place);
  plots.push({ chart, names, place });
}

function sizePlots() {
  for (const p of plots) {
    const room = { width: p.place.clientWidth, height: Math.max(70, p.place.clientHeight) };
    if (room.width !== p.chart.width || room.height !== p.chart.height) p.chart.setSize(room);
  }
}

function makePlots() {
  const limit = geometry.bend_limit_deg, most = geometry.working_pressure_kpa;
  plot("bend-plot", ["bend", "bendTable", "bendCommand"], [line(INK), line("#1f8fb8", false, 1.4), line(COMMAND, true)],
    (u, low, high) => [0, Math.max(30, Math.min(limit * 1.3, high * 1.08))], "°");
  plot("direction-plot", ["direction", "directionTable", "directionCommand"], [line(INK), line("#1f8fb8", false, 1.4), line(COMMAND, true)],
    () => [0, 360], "°", [0, 90, 180, 270, 360]);
  plot("pressure-plot", ["pressure0", "pressure1", "pressure2", "target0", "target1", "target2"],
    [...CHAMBER_COLOURS.map((c) => line(c)), ...CHAMBER_COLOURS.map((c) => line(c, true, 1.2))],
    (u, low, high) => [0, Math.max(0.25 * most, high * 1.08)], " kPa");
  plot("duty-plot", ["duty0", "duty1", "duty2"], CHAMBER_COLOURS.map((c) => line(c, false, 1.2)), () => [0, 1], "", [0, 0.5, 1]);
  new ResizeObserver(sizePlots).observe($("right"));
  sizePlots();
}

const turned = (degrees) => ((degrees % 360) + 360) % 360;

/* A line across the plot from 359 to 1 degree says nothing. */
function pushTurn(name, value) {
  const line = series[name], before = line[line.length - 1];
  line.push(value !== null && before != null && Math.abs(value - before) > 180 ? null : value);
}

function append(report) {
  const shown = (bend, direction) => (bend >= DIRECTION_FROM_DEG ? turned(direction) : null);
  series.time.push(report.time_s);
  series.bend.push(report.bend_deg);
  series.bendTable.push(report.shape.bend_deg);
  series.bendCommand.push(report.command ? report.command.bend_deg : null);
  pushTurn("direction", shown(report.bend_deg, report.direction_deg));
  pushTurn("directionTable", shown(report.shape.bend_deg, report.shape.direction_deg));
  pushTurn("directionCommand", report.command ? turned(report.command.direction_deg) : null);
  for (let c = 0; c < 3; c++) {
    series["pressure" + c].push(report.pressure_kpa[c]);
    series["target" + c].push(report.state === "ACTIVE" ? report.target_kpa[c] : null);
    series["duty" + c].push(report.duty[c]);
  }
  const from = report.time_s - WINDOW_S;
  let old = 0;
  while (series.time[old] < from) old++;
  if (old > 25) for (const name in series) series[name].splice(0, old);
}

function drawPlots() {
  const end = last.time_s, start = Math.max(series.time[0], end - WINDOW_S);
  for (const p of plots) {
    p.chart.batch(() => {
      p.chart.setData([series.time, ...p.names.map((n) => series[n])], true);
      p.chart.setScale("x", { min: start, max: Math.max(end, start + LEAST_S) });
    });
  }
}

/* --- words --- */

const fixed = (value, digits) => (value === null ? "–" : value.toFixed(digits));

/* Only numbers and words of this file go into the keys; what the board says goes in as text. */
function setKey(id, parts) {
  const place = $(id);
  place.textContent = "";
  for (const [colour, text, dashed] of parts) {
    const mark = document.createElement("i");
    mark.style.borderColor = colour;
    if (dashed) mark.className = "dashed";
    place.append(mark, text);
  }
}

function setKeys(r) {
  const c = r.command, turn = (bend, direction) => (bend >= DIRECTION_FROM_DEG ? turned(direction).toFixed(1) + "°" : "–");
  setKey("bend-key", [[INK, (r.measured ? "measured " : "predicted, no tip ") + fixed(r.bend_deg, 1) + "°"],
    ["#1f8fb8", "table " + fixed(r.shape.bend_deg, 1) + "°"], [COMMAND, "command " + (c ? fixed(c.bend_deg, 1) + "°" : "–"), true]]);
  setKey("direction-key", [[INK, turn(r.bend_deg, r.direction_deg)], ["#1f8fb8", "table " + turn(r.shape.bend_deg, r.shape.direction_deg)],
    [COMMAND, "command " + (c ? turned(c.direction_deg).toFixed(0) + "°" : "–"), true]]);
  setKey("pressure-key", [...CHAMBER_COLOURS.map((colour, i) => [colour, `chamber ${i + 1} ${fixed(r.pressure_kpa[i], 2)} kPa`]), [SUPPLY, "target", true]]);
  setKey("duty-key", CHAMBER_COLOURS.map((colour, i) => [colour, `valve ${i + 1} ${fixed(r.duty[i], 2)}`]));
  setKey("scene-key", [...CHAMBER_COLOURS.map((colour, i) => [colour, (i ? "" : "chamber ") + (i + 1)]), [INK, "tip sensor"], [COMMAND, "commanded", true]]);
}

function setWords(id, text, kind) {
  $(id).textContent = text;
  $(id).className = text === "none" ? "" : kind;
}

function setHealth(r) {
  const g = r.gap;
  setWords("faults", r.faults, "bad");
  setWords("warnings", r.warnings, "warn");
  $("gap").className = g.chamber > 0 || r.warnings.includes("gap") ? "warn" : "";
  $("gap").textContent = `${g.stage}; bend ${fixed(g.bend_deg, 2)} of ${fixed(g.bend_threshold_deg, 2)}°, position ${fixed(g.position_mm, 2)} of ` +
    `${fixed(g.position_threshold_mm, 2)} mm, pressures ${g.pressure_pa.map((p) => fixed(p, 0)).join(", ")} Pa`;
  $("sensors").textContent = `supply ${fixed(r.supply_kpa, 1)} kPa; tip ${r.tip_mm.map((v) => fixed(v, 1)).join(", ")} mm, ` +
    `${r.tip_samples} samples, ${r.tip_rejected} rejected; ${r.commands_refused} commands refused`;
}

/* --- arm and sliders --- */

const sliders = { bend: ["bend-text", "°", 1], direction: ["direction-text", "°", 0], co: ["co-text", " kPa", 2] };
const mine = () => last !== null && last.arm.armed && last.arm.page === page;

function showSliders() {
  for (const id in sliders) $(sliders[id][0]).textContent = Number($(id).value).toFixed(sliders[id][2]) + sliders[id][1];
}

function setArmed(armed) {
  $("arm").checked = armed;
  for (const id in sliders) $(id).disabled = !armed;
}

function showArm(r) {
  const isMine = mine();
  if (!sending) setArmed(isMine);
  $("arm-text").textContent = isMine ? "the sliders command" : r.arm.armed ? "another page is armed" : r.arm.why;
  $("clear").hidden = r.state !== "FAULT";
}

async function sendCommand() {
  lastSent = performance.now();
  await post("command", { bend_deg: Number($("bend").value), direction_deg: Number($("direction").value), co_contraction_kpa: Number($("co").value) });
}

async function attempt(what) {
  try { await what(); } catch (error) { say(error.message); }
}

async function arm() {
  sending = true;
  await attempt(async () => {
    say("");
    $("bend").value = 0;
    showSliders();
    await post("arm", {});
    await sendCommand();
    setArmed(true);
    if (last) last.arm = { armed: true, page, why: "" };
  });
  sending = false;
}

const disarm = () => attempt(() => post("disarm", {}));
const keepArm = () => { if (mine() && performance.now() - lastSent >= REPEAT_MS - 20) attempt(sendCommand); };

function sliderMoved() {
  showSliders();
  clearTimeout(soon);
  soon = setTimeout(() => { if (mine()) attempt(sendCommand); }, SOON_MS);
}

function wire() {
  $("bend").max = Math.floor(geometry.bend_limit_deg * 2) / 2;
  $("co").max = Math.floor(geometry.working_pressure_kpa * 10) / 20; /* half of it leaves room for a bend */
  for (const id in sliders) $(id).addEventListener("input", sliderMoved);
  $("arm").addEventListener("change", (e) => (e.target.checked ? arm() : disarm()));
  $("vent").addEventListener("click", () => attempt(() => post("vent", {})));
  $("clear").addEventListener("click", () => attempt(() => post("clear", {})));
  $("controls").addEventListener("submit", (e) => e.preventDefault());
  document.addEventListener("visibilitychange", () => { if (document.hidden && mine()) disarm(); });
  setInterval(keepArm, REPEAT_MS / 2);
  setInterval(checkAge, STALE_MS / 4);
  showSliders();
}

/* --- the stream --- */

function checkAge() {
  const age = performance.now() - heardAt;
  if (heardAt > 0 && age > STALE_MS) {
    $("state").textContent = "no link";
    $("state").className = "state";
    say(`no report for ${(age / 1000).toFixed(0)} s`);
  } else if ($("notice").textContent.startsWith("no report")) say("");
}

function takeEvent(report) {
  if (last && report.time_s < last.time_s) for (const name in series) series[name].length = 0; /* it was restarted */
  last = report;
  heardAt = performance.now();
  window.tribend.events++;
  append(report);
  $("state").textContent = report.state;
  $("state").className = "state " + report.state;
  $("clock").textContent = report.time_s.toFixed(1) + " s";
  showArm(report);
}

function drawAll() {
  if (last && window.tribend.drawn !== window.tribend.events) {
    window.tribend.drawn = window.tribend.events;
    setKeys(last);
    setHealth(last);
    drawPlots();
    scene.show(last);
  }
  requestAnimationFrame(drawAll);
}

async function start() {
  token = await findToken();
  const answer = await fetch("module", { headers: { Authorization: "Bearer " + token } });
  geometry = await answer.json();
  if (geometry.error) throw new Error(geometry.error);
  $("module").textContent = `${geometry.module} on ${geometry.bus}`;
  scene = new ModuleScene($("scene"), geometry);
  makePlots();
  wire();
  const stream = new EventSource(`events?page=${page}&token=${encodeURIComponent(token)}`);
  stream.onmessage = (e) => takeEvent(JSON.parse(e.data));
  requestAnimationFrame(drawAll);
}

attempt(start);
