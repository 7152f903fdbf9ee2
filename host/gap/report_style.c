#include "gap/report_style.h"

#include <stddef.h>

static const char *const light =
    "--paper:#ffffff;--ground:#f4f5f7;--ink:#1d2126;--muted:#5b636d;--rule:#d9dde2;"
    "--grid:#e6e9ed;--measured:#9aa3ad;--before:#d55e00;--after:#0072b2;"
    "--recalibrated:#009e73;--held:#f0f1f4;--accent:#0072b2;--warn:#9c4600;";
static const char *const dark =
    "--paper:#191c20;--ground:#101215;--ink:#e8eaed;--muted:#a2aab4;--rule:#363c44;"
    "--grid:#2a2f36;--measured:#7d8792;--before:#ee7f2d;--after:#56b4e9;"
    "--recalibrated:#2fc69a;--held:#22262b;--accent:#56b4e9;--warn:#f0a35e;";

static const char *const rules[] = {
    "*{box-sizing:border-box}",
    "body{margin:0;background:var(--ground);color:var(--ink)}",
    "body{font:15px/1.5 system-ui,'DejaVu Sans',sans-serif}",
    "main{max-width:1144px;margin:0 auto;padding:28px 16px 48px}",
    "h1{font-size:30px;line-height:1.2;margin:6px 0 6px}",
    "h2{font-size:20px;margin:0 0 4px}",
    "h3{font-size:13px;margin:16px 0 8px;color:var(--muted);font-weight:600;letter-spacing:.02em}",
    "h3:first-child{margin-top:0}",
    "p{margin:6px 0}",
    "a{color:var(--accent)}",
    "header{border-left:6px solid var(--accent);padding:2px 0 2px 18px;margin-bottom:16px}",
    "header.no-gap,header.recalibrate{border-color:var(--recalibrated)}",
    "header.unknown,header.insufficient-data{border-color:var(--before)}",
    ".eyebrow,.muted{color:var(--muted)}",
    ".eyebrow{font-size:13px;margin:0}",
    ".lead{font-size:18px;margin:0;max-width:62em}",
    "nav{font-size:13px;margin:12px 0 0}nav a{margin-right:16px;white-space:nowrap}",
    "section{background:var(--paper);border:1px solid var(--rule);border-radius:10px}",
    "section{padding:18px 20px;margin:0 0 16px}",
    ".cards{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:16px}",
    "@media(max-width:820px){.cards{grid-template-columns:minmax(0,1fr)}}",
    ".where{display:flex;flex-wrap:wrap;gap:8px 28px;align-items:center}",
    ".name{font-size:17px;font-weight:650}",
    ".effect+.effect{margin-top:14px;padding-top:12px;border-top:1px solid var(--rule)}",
    "table{border-collapse:collapse;font-variant-numeric:tabular-nums;width:100%}",
    "th{font-weight:600;color:var(--muted);font-size:13px;text-align:left}",
    "td,th{padding:4px 12px 4px 0;border-bottom:1px solid var(--grid);vertical-align:middle}",
    "tr:last-child>td{border-bottom:0}",
    "td.number,th.number{text-align:right}",
    "td.path{overflow-wrap:anywhere;min-width:280px}",
    "ul{margin:4px 0;padding-left:20px}li{margin:3px 0}",
    "code{font-family:ui-monospace,'DejaVu Sans Mono',monospace;font-size:.94em}",
    ".legend{font-size:13px;color:var(--muted)}",
    ".key{display:inline-block;width:22px;height:0;border-top:2px solid;margin:0 6px 4px 14px}",
    ".key:first-child,.swatch:first-child{margin-left:0}",
    ".key.measured{border-top-width:4px;border-color:var(--measured)}",
    ".key.before{border-color:var(--before)}.key.after{border-color:var(--after)}",
    ".swatch{display:inline-block;width:14px;height:14px;border-radius:3px;margin:0 6px -2px 14px}",
    ".swatch.before{background:var(--before)}.swatch.after{background:var(--after)}",
    ".swatch.recalibrated{background:var(--recalibrated)}",
    ".swatch.left{border:1px dashed var(--muted)}",
    ".swatch.held{background:var(--held);border:1px solid var(--rule)}",
    "details+details{margin-top:14px}summary{cursor:pointer;overflow-wrap:anywhere;margin:6px 0}",
    ".scroll{overflow-x:auto}",
    "svg{display:block;font-family:inherit}",
    "svg text{fill:var(--ink);font-size:13px}",
    "svg .tick{font-size:12px;fill:var(--muted)}",
    "svg .title{font-size:12.5px;font-weight:600}",
    "svg .striking{font-weight:700;fill:var(--ink)}",
    "svg .middle{text-anchor:middle}svg .end{text-anchor:end}",
    "svg .frame{fill:none;stroke:var(--rule)}",
    "svg .grid{stroke:var(--grid);fill:none}",
    "svg .zero{stroke:var(--measured);fill:none}",
    "svg .held{fill:var(--held)}",
    "svg .tint{fill:var(--accent)}",
    "svg .line{fill:none;stroke-linejoin:round;stroke-linecap:round}",
    "svg .line.measured{stroke:var(--measured);stroke-width:3}",
    "svg .line.before{stroke:var(--before);stroke-width:1.3}",
    "svg .line.after{stroke:var(--after);stroke-width:1.3}",
    "svg .band{stroke:none;fill-opacity:.22}",
    "svg .fill.before,svg .band.before{fill:var(--before)}",
    "svg .fill.after,svg .band.after{fill:var(--after)}",
    "svg .fill.recalibrated{fill:var(--recalibrated)}",
    "svg .fill.faint{fill:var(--after);fill-opacity:.45}",
    "svg .open{fill:none;stroke:var(--muted);stroke-dasharray:3 3}",
    "svg .rule{stroke:var(--ink);stroke-width:1.6;fill:none}",
    "svg .mark{stroke:var(--paper);stroke-width:1}",
    "svg .box{fill:var(--paper);stroke:var(--rule)}",
    "svg .box.here{fill:var(--accent);stroke:var(--accent)}",
    "svg text.here{fill:var(--paper);font-weight:700}",
    "svg .arrow{stroke:var(--muted);fill:none;stroke-width:1.3}",
    "@page{size:A4 landscape;margin:11mm}",
};

static const char *const print_rules[] = {
    "body{background:#fff;font-size:13px;-webkit-print-color-adjust:exact;print-color-adjust:exact}",
    "main{padding:0;max-width:none}nav{display:none}h1{font-size:24px}",
    ".cards{grid-template-columns:minmax(0,1fr) minmax(0,1fr)}",
    "section{border:0;padding:8px 0;margin:0 0 10px}",
    "td,th{padding-top:2px;padding-bottom:2px}",
    ".scroll{overflow:visible}svg{max-width:100%;height:auto}",
    "svg,tr,header,.effect,li{break-inside:avoid}h2,h3,summary{break-after:avoid}",
};

static void put_all(FILE *out, const char *const *lines, size_t count) {
    for (size_t i = 0; i < count; i++) {
        fprintf(out, "%s\n", lines[i]);
    }
}

void report_style(FILE *out) {
    fprintf(out, "<style>\n:root{color-scheme:light dark;%s}\n@media(prefers-color-scheme:dark){:root{%s}}\n",
            light, dark);
    put_all(out, rules, sizeof rules / sizeof rules[0]);
    fprintf(out, "@media print{:root{%s}\n", light);
    put_all(out, print_rules, sizeof print_rules / sizeof print_rules[0]);
    fputs("}\n</style>\n", out);
}
