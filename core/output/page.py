"""The house style of pages that open offline, without scripts: what the reports share."""

from __future__ import annotations

from collections.abc import Iterable

STYLE = """
:root { color-scheme: light dark; --ink: #1d2126; --quiet: #656d78; --paper: #fff; --line: #e2e5e9; --soft: #f5f6f8;
  --good: #1a7041; --good-soft: #e9f5ee; --bad: #b3261e; --bad-soft: #fdecea; --link: #1f5fbf; }
@media (prefers-color-scheme: dark) { :root { --ink: #dfe3e8; --quiet: #98a1ad; --paper: #15181c; --line: #2d333b;
  --soft: #1d2127; --good: #6fcf97; --good-soft: #16281e; --bad: #ff8a80; --bad-soft: #361b1a; --link: #86b4ff; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 1560px; margin: 0 auto; padding: 1rem clamp(0.75rem, 2vw, 2rem) 4rem; }
header { padding: 1rem 1.25rem; border-radius: 8px; border-left: 6px solid; }
header.good, header.bad { font-weight: 400; } header p { margin: 0.2rem 0 0; color: var(--ink); }
h1 { margin: 0; font-size: 1.7rem; line-height: 1.2; } h2 { margin: 2rem 0 0.6rem; font-size: 1.2rem; }
h2.good, h2.bad { background: none; color: var(--ink); } h2.good .mark { color: var(--good); }
h2.bad .mark { color: var(--bad); } a { color: var(--link); text-decoration: none; }
a:hover { text-decoration: underline; }
p { margin: 0.3rem 0; max-width: 60rem; } .quiet, header .quiet { color: var(--quiet); font-size: 0.87rem; }
.good { background: var(--good-soft); color: var(--good); } .bad { background: var(--bad-soft); color: var(--bad); }
.scroll { overflow-x: auto; max-width: 100%; }
table { border-collapse: collapse; font-size: 0.87rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.28rem 0.45rem; border-bottom: 1px solid var(--line); text-align: left; white-space: nowrap; }
th { font-weight: 600; } tbody th { position: sticky; left: 0; background: var(--paper); }
tbody th.good { background: var(--good-soft); } tbody th.bad { background: var(--bad-soft); }
thead th { color: var(--quiet); line-height: 1.25; vertical-align: bottom; }
.n { text-align: right; } .first { border-left: 1px solid var(--line); }
.mark { display: inline-block; width: 1em; text-align: center; font-weight: 600; }
section { margin-top: 2.5rem; border-top: 1px solid var(--line); } section h2 { margin-top: 1.2rem; }
.failures { margin: 0.6rem 0; padding: 0.5rem 1rem; border-radius: 6px; list-style: none; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 340px), 1fr)); gap: 0.8rem;
  margin: 0.8rem 0; }
figure { margin: 0; } figcaption { color: var(--quiet); font-size: 0.82rem; padding-top: 0.2rem; }
img { display: block; width: 100%; aspect-ratio: 4 / 3; object-fit: contain; background: var(--soft);
  border-radius: 4px; }
details { margin: 0.5rem 0; } summary { cursor: pointer; color: var(--link); }
pre { background: var(--soft); padding: 0.6rem 0.8rem; border-radius: 6px; overflow-x: auto; white-space: pre-wrap; }
"""


def table(head: str, rows: Iterable[str]) -> str:
    """A table that scrolls sideways where it is too wide; head and rows: `<tr>…</tr>`."""
    top = f"<thead>{head}</thead>" if head else ""
    return f'<div class="scroll"><table>{top}<tbody>{"".join(rows)}</tbody></table></div>'
