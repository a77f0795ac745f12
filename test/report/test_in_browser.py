"""Pages in a real browser: they ask for nothing, complain of nothing, and every chart is drawn.

Needs Chromium (`apt install chromium`) and Playwright (`pip install sgp_ros[test]`). Pictures of a
page differ from one version of a browser to the next, so what is compared is what stands on it.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from sgp_ros.report.diagnosis import write_diagnosis
from sgp_ros.report.next_steps import Given, after_diagnosis
from sgp_ros.rigid.tree import read_urdf
from test.report.diagnoses import ASYMMETRIC, COULOMB, MASS, diagnosis, search
from test.report.test_charts import ARM

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser')
STRUCTURE = Path(__file__).parent / 'page_structure.json'
WIDTHS = (390, 1280)
WAIT_MS, MOST_S = 30_000, 240.0
"""Of one action [ms], and of the browser as a whole [s], after which it is ended."""

api = pytest.importorskip('playwright.sync_api', reason='no Playwright: pip install sgp_ros[test]')
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason='no Chromium: apt install chromium')

DRAWN = """
figure => {
  const canvas = figure.querySelector('canvas');
  if (!canvas || !canvas.width) return 0;
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const seen = new Set();
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3]) seen.add((data[i] << 16) + (data[i + 1] << 8) + data[i + 2]);
  }
  return seen.size;
}
"""
STATE = """
() => ({
  headings: [...document.querySelectorAll('h2')].map(h => h.textContent),
  charts: [...document.querySelectorAll('figure[data-chart]')].map(f => ({
    name: f.dataset.chart, curves: f.querySelectorAll('.u-series:not(.hidden)').length,
  })),
  tables: document.querySelectorAll('table:not(.u-legend)').length,
  commands: [...document.querySelectorAll('pre.command code')].map(c => c.textContent),
  wide: document.documentElement.scrollWidth,
})
"""


@pytest.fixture(scope='module')
def page_path(tmp_path_factory):
    """The page of a diagnosis with all of its parts."""
    out = tmp_path_factory.mktemp('page')
    tree = replace(read_urdf(ARM), joint_names=('shoulder', 'elbow'))
    found = diagnosis('missing_physics', [COULOMB], alternatives=[ASYMMETRIC], errors=[MASS])
    found = replace(found, law_searches=(search(),))
    write_diagnosis(
        out,
        found,
        tree,
        after_diagnosis(
            found.verdict, Given('a.mcap', 'arm.urdf'), Path('out'), has_setup_error=False
        ),
    )
    return out / 'report.html'


@pytest.fixture(scope='module')
def browser(tmp_path_factory):
    """Chromium without a window, in a group of processes that ends with the tests, or before.

    In a container its own sandbox cannot be set up. Whatever hangs, a watchdog ends the group, and
    every wait for it then fails.
    """
    profile = tmp_path_factory.mktemp('profile')
    options = ('--headless', '--no-sandbox', '--disable-gpu', '--no-first-run',
               '--disable-background-networking', '--remote-debugging-port=0')  # fmt: skip
    process = subprocess.Popen(
        [CHROMIUM, *options, f'--user-data-dir={profile}'], start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    watchdog = threading.Timer(MOST_S, _end, [process])
    watchdog.daemon = True
    watchdog.start()
    try:
        address = _address(process, profile / 'DevToolsActivePort')
        with api.sync_playwright() as playwright:
            yield playwright.chromium.connect_over_cdp(address, timeout=WAIT_MS)
    finally:
        watchdog.cancel()
        _end(process)


def _address(process, path):
    """Return where a browser listens, once it has written that down."""
    while process.poll() is None:
        if path.exists() and len(lines := path.read_text().split()) == 2:
            return f'http://127.0.0.1:{lines[0]}'
        time.sleep(0.05)
    raise RuntimeError(f'Chromium ended with {process.returncode}, or did not start in time')


def _end(process):
    """End a process and its children, whatever they do."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.fixture
def opened(browser, page_path, request):
    """The page at a width and in a colour scheme, what it asked for and complained of."""
    width, scheme = request.param
    context = browser.new_context(viewport={'width': width, 'height': 800}, color_scheme=scheme)
    context.set_default_timeout(WAIT_MS)
    page, said = context.new_page(), []
    page.on('console', lambda message: said.append(message.text))
    page.on('pageerror', lambda error: said.append(str(error)))
    page.on('request', lambda asked: said.append(asked.url))
    page.goto(page_path.as_uri())
    yield page, said
    context.close()


everywhere = pytest.mark.parametrize(
    'opened', [(w, s) for w in WIDTHS for s in ('light', 'dark')], indirect=True
)
once = pytest.mark.parametrize('opened', [(1280, 'light')], indirect=True)


@everywhere
def test_the_page_asks_for_nothing_and_every_chart_is_drawn(opened, page_path):
    """At the width of a phone and of a screen, light and dark; nothing reaches over the edge."""
    page, said = opened
    assert said == [page_path.as_uri()]
    state = page.evaluate(STATE)
    assert state['wide'] <= page.viewport_size['width'] + 1
    for figure in page.locator('figure[data-chart]').all():
        assert figure.evaluate(DRAWN) > 20, figure.get_attribute('data-chart')
        fits = '(f) => f.hidden || f.querySelector(".uplot").clientWidth <= f.clientWidth'
        assert figure.evaluate(fits), figure.get_attribute('data-chart')


@once
def test_the_structure_of_the_page_is_the_committed_one(opened):
    """Headings, charts with their curves, tables and commands; a change of them is looked at."""
    page, _ = opened
    state = page.evaluate(STATE)
    del state['wide']
    assert state == json.loads(STRUCTURE.read_text(encoding='utf-8'))


@once
def test_zoom_is_shared_by_the_charts_of_one_recording(opened):
    """The buttons narrow the stretch of time that is shown, in linked charts too, and widen it."""
    page, _ = opened
    ends = """() => ['effort elbow', 'motion elbow open_0.5'].map(name => {
      const { scales } = document.querySelector(`figure[data-chart="${name}"] .uplot`).chart;
      return [scales.x.min, scales.x.max];
    })"""
    before = page.evaluate(ends)
    figure = page.locator('figure[data-chart="effort elbow"]')
    figure.locator('button[data-zoom="in"]').click()
    after = page.evaluate(ends)
    assert after[0] == after[1]
    assert after[0][1] - after[0][0] == pytest.approx(0.5 * (before[0][1] - before[0][0]))
    figure.locator('button[data-zoom="whole"]').click()
    low, high = page.evaluate(ends)[1]
    assert (low, high) == (0.0, pytest.approx(14.975))
    figure.locator('.u-over').hover()
    values = page.locator('figure[data-chart="motion elbow open_0.5"] .u-series .u-value')
    values = values.all_text_contents()  # the cursor is linked: the other chart answers
    assert all(re.search(r'\d', value) for value in values)


@once
def test_one_of_several_replays_is_seen_at_a_time(opened):
    """A button shows another one, as wide as the page, and says that it is pressed."""
    page, _ = opened
    seen = '() => [...document.querySelectorAll(".choice figure")].map(f => f.offsetWidth > 300)'
    assert page.evaluate(seen) == [True, False, False]
    page.locator('button[data-option="motion elbow open_2"]').click()
    assert page.evaluate(seen) == [False, True, False]
    pressed = page.locator('button[data-option][aria-pressed="true"]')
    assert pressed.all_text_contents() == ['2 s']


@once
def test_a_table_is_copied_with_its_columns(opened):
    """Into a spreadsheet: cells of a row are told apart by tabs."""
    page, _ = opened
    text = page.evaluate("""() => {
      const table = [...document.querySelectorAll('table.stack')].at(-1);
      getSelection().selectAllChildren(table);
      return getSelection().toString();
    }""")
    row = next(line for line in text.splitlines() if line.startswith('Coulomb friction that'))
    assert row.split('\t')[1] == 'elbow'


@once
def test_paper_shows_pictures_instead_of_charts(opened):
    """Charts of a script are replaced by pictures drawn before, and no control is printed."""
    page, _ = opened
    shown = '() => [...document.querySelectorAll("img.still")].every(i => i.offsetHeight > 50)'
    assert not page.evaluate(shown)
    page.emulate_media(media='print')
    assert page.evaluate(shown)
    assert not page.locator('button[data-zoom="in"]').first.is_visible()
    assert len(page.pdf()) > 10_000
