// Draws the charts of the page from the data beside them. No request leaves the page.
'use strict';
(() => {
  const root = document.documentElement;
  root.classList.add('scripted');
  const data = JSON.parse(document.getElementById('chart-data').textContent);
  const tone = name => getComputedStyle(root).getPropertyValue('--' + name).trim();
  const groups = {};       // charts that share cursor and zoom
  const drawn = new Map(); // figure -> chart
  const dash = { dashed: [7, 4] };
  const width = { thick: 4, dashed: 1.8, line: 1.5, points: 0 };

  const number = x => x == null ? '–' : Number(x.toPrecision(4)).toString();
  function ticks(u, splits, i, space, step) { // as many digits as tell them apart
    let digits = 0;
    while (digits < 7 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits += 1;
    const shown = x => digits < 7 ? x.toFixed(digits) : Number(x.toPrecision(4)).toString();
    return splits.map(x => x == null ? '' : shown(x));
  }
  const axis = (label, log) => ({
    ...(log ? {} : { values: ticks }), label, labelSize: 20, size: 46, stroke: tone('ink'), labelFont: '12px system-ui',
    font: '12px system-ui', grid: { stroke: tone('grid'), width: 1 }, ticks: { stroke: tone('grid') },
  });

  function marked(u, spans) {
    if (!spans.length) return;
    const { ctx, bbox } = u;
    ctx.save();
    ctx.fillStyle = tone('span');
    for (const [lo, hi] of spans) {
      const a = Math.max(u.valToPos(lo, 'x', true), bbox.left);
      const b = Math.min(u.valToPos(hi, 'x', true), bbox.left + bbox.width);
      if (b > a) ctx.fillRect(a, bbox.top, b - a, bbox.height);
    }
    ctx.restore();
  }

  function bounds(u, spans) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.strokeStyle = tone('ink');
    ctx.setLineDash([5, 4]);
    for (const x of spans.flat()) {
      const at = u.valToPos(x, 'x', true);
      if (at < bbox.left || at > bbox.left + bbox.width) continue;
      ctx.beginPath(); ctx.moveTo(at, bbox.top); ctx.lineTo(at, bbox.top + bbox.height); ctx.stroke();
    }
    ctx.restore();
  }

  const rgb = text => text.match(/[0-9a-f]{2}/gi).map(x => parseInt(x, 16));
  function mixed(value, reach) { // blue below zero, the page at zero, orange above
    const share = Math.max(-1, Math.min(1, value / reach));
    const [from, to] = [rgb(tone('zero')), rgb(tone(share < 0 ? 'below' : 'above'))];
    return 'rgb(' + from.map((x, i) => Math.round(x + (to[i] - x) * Math.abs(share))) + ')';
  }

  function cells(u, c) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.fillStyle = tone('unseen');
    ctx.fillRect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip();
    const px = c.x.map(x => Math.round(u.valToPos(x, 'x', true)));
    const py = c.y.map(y => Math.round(u.valToPos(y, 'y', true)));
    c.values.forEach((column, i) => column.forEach((value, j) => {
      if (value == null) return;
      ctx.fillStyle = mixed(value, c.reach);
      ctx.fillRect(px[i], py[j + 1], px[i + 1] - px[i], py[j] - py[j + 1]);
    }));
    ctx.restore();
  }

  const tall = wide => Math.round(Math.max(230, Math.min(320, wide * 0.42)));

  function options(chart, at) {
    const series = [{ label: chart.x_label.replace(/ \[.*/, ''), value: (u, x) => number(x) }];
    const values = [chart.x], bands = [];
    for (const s of chart.series) {
      const colour = tone(s.tone);
      if (s.low) {
        values.push(s.low, s.high);
        const hidden = { stroke: 'transparent', points: { show: false }, class: 'hidden' };
        series.push({ ...hidden }, { ...hidden });
        bands.push({ series: [series.length - 1, series.length - 2], fill: colour + '38' });
      }
      values.push(s.y);
      const cloud = s.style === 'points';
      series.push({
        label: s.label, stroke: colour, width: width[s.style], dash: dash[s.style],
        paths: cloud ? () => null : undefined, value: (u, y) => number(y),
        points: { show: cloud, size: s.tone === 'measured' ? 6 : 3.5, fill: colour, stroke: colour },
      });
    }
    const scales = { x: { time: false, distr: chart.log ? 3 : 1 }, y: { distr: chart.log ? 3 : 1 } };
    if (chart.limit) { // what is in view, as far as it lies within the limits
      const [low, high] = chart.limit;
      scales.y = { range: (u, from, to) => {
        if (from === null || from >= high || to <= low) return chart.limit;
        const pad = 0.05 * Math.max(Math.min(to, high) - Math.max(from, low), 1e-6 * (high - low));
        return [Math.max(from - pad, low), Math.min(to + pad, high)];
      } };
    }
    const c = chart.cells;
    if (c) {
      scales.x.range = [c.x[0], c.x[c.x.length - 1]];
      scales.y = { range: [c.y[0], c.y[c.y.length - 1]] };
      values[0] = [c.x[0], c.x[c.x.length - 1]];
      values.push([null, null]);
      series.push({ show: true, class: 'hidden' });
    }
    return [values, {
      width: at.clientWidth || 600, height: tall(at.clientWidth || 600),
      scales, series, bands,
      axes: [axis(chart.x_label, chart.log), { ...axis(chart.y_label, chart.log), size: 58 }],
      cursor: {
        drag: { x: true, y: false, uni: 10 },
        ...(chart.group ? { sync: { key: chart.group, setSeries: false } } : {}),
      },
      legend: { show: !c },
      hooks: {
        drawClear: [u => c ? cells(u, c) : marked(u, chart.spans)],
        draw: [u => bounds(u, chart.spans)],
        setScale: [(u, key) => { if (key === 'x' && chart.group) follow(u, chart.group); }],
      },
    }];
  }

  let following = false;
  function follow(u, group) { // the others show the same stretch of time
    if (following) return;
    following = true;
    const { min, max } = u.scales.x;
    for (const other of groups[group] || []) if (other !== u) other.setScale('x', { min, max });
    following = false;
  }

  function moved(u, kind) {
    const x = u.data[0], whole = [x[0], x[x.length - 1]];
    let { min, max } = u.scales.x;
    const span = max - min, centre = 0.5 * (min + max);
    if (kind === 'whole') [min, max] = whole;
    if (kind === 'in') [min, max] = [centre - span / 4, centre + span / 4];
    if (kind === 'out') [min, max] = [centre - span, centre + span];
    if (kind === 'left' || kind === 'right') {
      const step = (kind === 'left' ? -0.4 : 0.4) * span;
      [min, max] = [min + step, max + step];
    }
    u.setScale('x', { min: Math.max(min, whole[0]), max: Math.min(max, whole[1]) });
  }

  function build(figure) {
    const chart = data[figure.dataset.chart], at = figure.querySelector('.plot');
    const [values, wanted] = options(chart, at);
    const u = new uPlot(wanted, values, at);
    u.root.chart = u;
    if (chart.group) (groups[chart.group] ||= []).push(u);
    drawn.set(figure, u);
    if (chart.view) u.setScale('x', { min: chart.view[0], max: chart.view[1] });
    figure.querySelectorAll('button[data-zoom]').forEach(button => {
      button.onclick = () => moved(drawn.get(figure), button.dataset.zoom);
    });
  }

  document.querySelectorAll('.choice').forEach(choice => { // one of several charts is seen
    const buttons = [...choice.querySelectorAll('button[data-option]')];
    const show = wanted => {
      choice.querySelectorAll('figure[data-chart]').forEach(f => {
        f.hidden = f.dataset.chart !== wanted;
        fit(f);
      });
      for (const b of buttons) b.setAttribute('aria-pressed', String(b.dataset.option === wanted));
    };
    for (const b of buttons) b.onclick = () => show(b.dataset.option);
    show(buttons[0].dataset.option);
  });

  const figures = [...document.querySelectorAll('figure[data-chart]')];
  function draw() {
    for (const u of drawn.values()) u.destroy();
    drawn.clear();
    for (const key in groups) groups[key].length = 0;
    figures.forEach(build);
  }
  draw();
  function fit(figure) { // to the width of the page; what is hidden has none
    const u = drawn.get(figure), wide = figure.querySelector('.plot').clientWidth;
    if (u && wide && wide !== u.width) u.setSize({ width: wide, height: tall(wide) });
  }
  new ResizeObserver(() => figures.forEach(fit)).observe(document.body);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  document.addEventListener('toggle', e => {
    if (e.target.open) e.target.querySelectorAll('figure[data-chart]').forEach(fit);
  }, true);

  const rank = cell => cell.dataset.value ?? cell.textContent.trim();
  function sorted(table, column, sign) { // empty cells last, numbers before words
    const rows = [...table.tBodies[0].rows], keys = new Map();
    for (const row of rows) keys.set(row, rank(row.cells[column]));
    const order = (a, b) => {
      if (a === '' || b === '') return (a === '') - (b === '');
      const [x, y] = [Number(a), Number(b)];
      if (Number.isNaN(x) || Number.isNaN(y)) return sign * a.localeCompare(b, undefined, { numeric: true });
      return sign * (x - y);
    };
    table.tBodies[0].append(...rows.sort((a, b) => order(keys.get(a), keys.get(b))));
  }
  document.querySelectorAll('table.sortable').forEach(table => {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      head.tabIndex = 0;
      head.onclick = () => {
        const falls = head.getAttribute('aria-sort') === 'ascending';
        heads.forEach(other => other.removeAttribute('aria-sort'));
        head.setAttribute('aria-sort', falls ? 'descending' : 'ascending');
        sorted(table, column, falls ? -1 : 1);
      };
      head.onkeydown = e => { if (e.key === 'Enter') head.onclick(); };
    });
  });

  document.querySelectorAll('pre.command').forEach(block => {
    const button = document.createElement('button');
    button.textContent = 'copy';
    button.onclick = () => {
      const range = document.createRange();
      range.selectNodeContents(block.querySelector('code'));
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      button.textContent = document.execCommand('copy') ? 'copied' : 'selected';
    };
    block.append(button);
  });
})();
