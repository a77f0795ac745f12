"""The page of a campaign says what changed, escapes its input, and sorts its tables."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import duckdb
import pytest

from sgp_proof.campaign.wear import LEVEL, World, draw_results
from sgp_ros.apps.campaign import write_campaign

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser')
ROOT = Path(__file__).parents[2]
HOSTILE = '<b>left & "right"</b>'


@pytest.fixture(scope='module')
def written(tmp_path_factory):
    """A campaign with a change, a failure and a hostile name."""
    out = tmp_path_factory.mktemp('page')
    results = draw_results(World(recordings=80, per_day=(2, 4)), 4, begin=50)
    for result in results:
        result['robot'] = HOSTILE
        rows = result['tasks']['identify']['rows']
        rows[:] = [row for row in rows if row['joint'] == 'elbow']
    results[7]['tasks'] = {'identify': {'failure': f'{HOSTILE} contains no messages'}}
    return out, write_campaign(out, results, ['a remark'])


def test_what_changed_comes_first_and_nothing_is_markup(written):
    out, content = written
    page = (out / 'report.html').read_text()
    assert HOSTILE not in page
    assert '1 of 2 frictions and gains changed' in page
    changed = next(t for t in content['trends'] if t['changes'])
    assert f'at {changed["changes"][0]["recording"]}' in page
    assert content['failures'][0]['recording'] == '0007.mcap'
    assert 'a remark' in page


def test_duckdb_opens_the_table(written):
    """Every recording has a row, and the numbers are those of the results."""
    out, content = written
    (rows,) = duckdb.sql(
        f"select count(*), count(distinct recording), min(value) from '{out}/results.parquet'"
    ).fetchall()
    assert rows[:2] == (content['rows'], 80)
    assert rows[2] > 0.0


def test_the_query_of_the_documents_runs(written, monkeypatch):
    """Weighted means by robot: both quantities of the one robot, within their level."""
    page = (ROOT / 'docs' / 'campaign.md').read_text(encoding='utf-8')
    monkeypatch.chdir(written[0])
    found = duckdb.sql(re.search(r'```sql\n(.*?)```', page, re.DOTALL)[1]).fetchall()
    assert [row[2] for row in found] == ['elbow.coulomb', 'elbow.viscous']
    for row in found:
        assert row[3] == 79
        assert row[4] == pytest.approx(LEVEL, rel=0.2)


@pytest.mark.skipif(CHROMIUM is None, reason='no Chromium: apt install chromium')
def test_a_table_is_sorted_by_a_click(written):
    api = pytest.importorskip('playwright.sync_api', reason='no Playwright')
    said = []
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=['--no-sandbox', '--disable-gpu']
        )
        page = browser.new_page(viewport={'width': 390, 'height': 800})
        page.on('console', lambda message: said.append(message.text))
        page.on('pageerror', lambda error: said.append(str(error)))
        page.goto((written[0] / 'report.html').as_uri())
        assert page.evaluate('document.documentElement.scrollWidth') <= 390
        for first in ('elbow.coulomb', 'elbow.viscous'):
            page.click('table.sortable th:has-text("chance")')
            assert page.inner_text('table.sortable tbody tr td').startswith(first)
        assert page.locator('figure[data-chart] canvas').count() == 2
        browser.close()
    assert said == []
