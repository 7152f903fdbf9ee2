/* The live view as people use it, in headless Chromium: prints a line a check, "ok NAME" or "failed NAME: why".
 * node view_browser.mjs MODULES ADDRESS SCREENSHOT.png */
import { createRequire } from "node:module";
import { resolve } from "node:path";

const [modules, address, screenshot] = process.argv.slice(2);
const { chromium } = createRequire(resolve(modules) + "/")("playwright-core");
const WITHIN_MS = 60000; /* a bound for hangs; nothing is timed */
const problems = [];
let failed = 0;

async function check(name, what) {
  if (failed > 0) return; /* each goes on from where the last one left the module */
  try {
    await what();
    console.log("ok " + name);
  } catch (error) {
    failed++;
    console.log(`failed ${name}: ${String(error.message).split("\n")[0]}`);
    console.log("the page says: " + (await page.locator("#arm-text").textContent()) + "; " + (await page.locator("#notice").textContent()));
  }
}

function must(condition, why) { if (!condition) throw new Error(why); }

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args: ["--no-sandbox", "--disable-gpu"] });

async function open(size) {
  const context = await browser.newContext({ viewport: size });
  const page = await context.newPage();
  page.setDefaultTimeout(WITHIN_MS);
  page.on("pageerror", (error) => problems.push(error.message));
  page.on("console", (message) => { if (message.type() === "error" && !message.text().includes("409")) problems.push(message.text()); });
  page.on("request", (request) => { if (!request.url().startsWith(address) && !request.url().startsWith("data:")) problems.push("asks " + request.url()); });
  await page.goto(address);
  return page;
}

/* waitForFunction() would have to evaluate text, which the page's policy forbids. */
async function until(page, what, argument) {
  const end = Date.now() + WITHIN_MS;
  while (!(await page.evaluate(what, argument))) {
    must(Date.now() < end, "never: " + String(what).slice(0, 120) + " " + (argument ?? ""));
    await new Promise((resolve) => setTimeout(resolve, 30));
  }
}

const text = (page, id) => page.locator("#" + id).textContent();
const state = (page, wanted) => until(page, (w) => document.getElementById("state").textContent === w, wanted);
const measured = (page, test, argument) =>
  until(page, ([t, a]) => {
    const bend = Number(/ (-?[\d.]+)°/.exec(document.getElementById("bend-key").textContent)?.[1]);
    return t === "over" ? bend > a : bend < a;
  }, [test, argument]);
const slide = (page, id, value) => page.locator("#" + id).evaluate((slider, v) => {
  slider.value = v;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
}, value);
const click = (page, id) => page.locator("#" + id).evaluate((element) => element.click());
const pixels = (page, selector) => page.locator(selector).evaluate((canvas) => canvas.toDataURL());
const armed = (page, wanted) => until(page, (w) => document.getElementById("arm").checked === w && window.tribend.events > 0, wanted);

async function move(page, bend) {
  await click(page, "arm");
  await armed(page, true);
  await slide(page, "bend", bend);
  await state(page, "ACTIVE");
  await measured(page, "over", 0.6 * bend);
}

const page = await open({ width: 1280, height: 800 });
await check("page_loads_and_reports", async () => {
  await state(page, "SAFE");
  must((await text(page, "module")).startsWith("paper-semicircle"), "module " + (await text(page, "module")));
  must((await text(page, "faults")) === "none", "faults " + (await text(page, "faults")));
});
await check("nothing_scrolls_at_1280_by_800", async () => {
  const size = await page.evaluate(() => [document.documentElement.scrollWidth, document.documentElement.scrollHeight]);
  must(size[0] <= 1280 && size[1] <= 800, "page is " + size);
});
await check("sliders_are_dead_until_armed", async () => {
  must(await page.locator("#bend").isDisabled(), "the bend slider is live");
  await slide(page, "bend", 70);
  const events = await page.evaluate(() => window.tribend.events);
  await until(page, (e) => window.tribend.events > e + 10, events);
  must((await text(page, "state")) === "SAFE", "it moved");
});
await check("plots_and_module_move_with_arm_and_slider", async () => {
  await until(page, () => window.tribend.drawn > 0);
  const before = await Promise.all(["#bend-plot canvas", "#pressure-plot canvas", "#scene"].map((s) => pixels(page, s)));
  await move(page, 60);
  await slide(page, "direction", 30);
  await measured(page, "over", 55);
  await until(page, () => Math.abs(Number(/(-?[\d.]+)°/.exec(document.getElementById("direction-key").textContent)?.[1]) - 30) < 4);
  const after = await Promise.all(["#bend-plot canvas", "#pressure-plot canvas", "#scene"].map((s) => pixels(page, s)));
  after.forEach((picture, i) => must(picture !== before[i], "canvas " + i + " stands still"));
});
await page.screenshot({ path: screenshot });
await check("another_page_cannot_take_the_arm", async () => {
  const other = await open({ width: 800, height: 700 });
  await state(other, "ACTIVE");
  await click(other, "arm");
  await until(other, () => document.getElementById("notice").textContent.includes("another page is armed"));
  await armed(other, false);
  await other.context().close();
  must((await text(page, "state")) === "ACTIVE", "it stopped the first page");
});
await check("disarming_vents", async () => {
  await click(page, "arm");
  await state(page, "SAFE");
  await measured(page, "under", 5);
  await armed(page, false);
});
await check("vent_stops_and_disarms", async () => {
  await move(page, 50);
  await click(page, "vent");
  await state(page, "SAFE");
  await armed(page, false);
  must((await text(page, "arm-text")) === "vented by hand", await text(page, "arm-text"));
});
await check("vent_of_another_page_stops_it_too", async () => {
  const other = await open({ width: 800, height: 700 });
  await move(page, 50);
  await click(other, "vent");
  await state(page, "SAFE");
  await armed(page, false);
  await other.context().close();
});
await check("lost_connection_vents", async () => {
  await move(page, 50);
  await page.route("**/command", (route) => route.abort());
  await state(page, "SAFE");
  must((await text(page, "faults")) === "none", "faults " + (await text(page, "faults")));
  must((await text(page, "arm-text")).includes("fell silent"), await text(page, "arm-text"));
  await page.unroute("**/command");
});
await check("closing_the_page_vents", async () => {
  const other = await open({ width: 800, height: 700 });
  await move(other, 50);
  await other.context().close();
  await state(page, "SAFE");
  await until(page, () => document.getElementById("arm-text").textContent.includes("closed") ||
    document.getElementById("arm-text").textContent.includes("disarmed"));
});
await check("page_has_no_errors_and_asks_nobody_else", async () => {
  const wrong = problems.filter((p) => !p.includes("ERR_FAILED")); /* the posts that were cut off on purpose */
  must(wrong.length === 0, [...new Set(wrong)].join("; "));
});
await browser.close();
process.exit(failed === 0 ? 0 : 1);
