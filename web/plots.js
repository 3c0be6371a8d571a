// Draws every plot of the report with Plotly, from the same record (src/plots/chart.rs) from which the program draws its files.
// Nothing is computed here: a mark says what is drawn, and which column of the view (axiscal-view/1) holds it.
'use strict';
globalThis.axiscalPlots = (() => {
  // Okabe and Ito's colours, which colour-blind people tell apart; what has a colour has a shape or a dash, too
  const OKABE = { orange: '#E69F00', sky: '#56B4E9', green: '#009E73', blue: '#0072B2', red: '#D55E00', purple: '#CC79A7' };
  const SYMBOL = { circle: 'circle', square: 'square', triangle: 'triangle-up', diamond: 'diamond', cross: 'x-thin-open', tick: 'line-ns-open' };
  const MANY = 4000; // more points than this are drawn by the graphics card

  // Plotly reads a few HTML tags in its texts: names come from files of the user's own
  const safe = (text) => String(text).replaceAll('&', '&amp;').replaceAll('<', '&lt;').replaceAll('>', '&gt;');

  /** Three significant digits, plainly written. */
  function digits(x, n = 3) {
    if (x === null || x === undefined || !Number.isFinite(x)) return '–';
    if (x === 0) return '0';
    const magnitude = Math.floor(Math.log10(Math.abs(x)));
    if (magnitude < -7 || magnitude > 6) return x.toExponential(n - 1);
    return x.toFixed(Math.max(0, n - 1 - magnitude)).replace('-', '−');
  }

  /** A value with the digits that its uncertainty leaves. */
  function valued(x, sigma) {
    if (x === null || x === undefined) return '–';
    if (!sigma || !Number.isFinite(sigma)) return digits(x);
    const places = Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(sigma))));
    return (Number(x.toFixed(places)) + 0).toFixed(places).replace(/^-(?=[0.]*$)/, '').replace('-', '−');
  }

  const colours = (el) => {
    const style = getComputedStyle(el);
    const of = (name) => style.getPropertyValue(name).trim();
    return { ink: of('--ink'), paper: of('--paper'), muted: of('--muted'), grid: of('--grid'), band: of('--band'), good: of('--good'), act: of('--act') };
  };

  function layout(el, more = {}) {
    const c = colours(el);
    const axis = { gridcolor: c.grid, zerolinecolor: c.muted, linecolor: c.muted, tickcolor: c.muted, automargin: true, ticks: 'outside', ticklen: 3 };
    const out = {
      paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)',
      font: { family: 'system-ui, sans-serif', size: 12, color: c.ink },
      margin: { l: 8, r: 12, t: 8, b: 44 }, showlegend: false, hoverlabel: { font: { family: 'system-ui, sans-serif' } },
      // stated, so that a page which is made ready for the printer is drawn in its new size at once
      dragmode: 'zoom', width: el.clientWidth || undefined, height: el.clientHeight || undefined, ...more,
    };
    for (const name of ['xaxis', 'yaxis']) {
      // below, the margin is given: names that need more room ask for it
      out[name] = { ...axis, automargin: name === 'yaxis' || Boolean(more[name]?.ticktext), ...more[name] };
      if (out[name].title) out[name].title = { standoff: 8, ...out[name].title };
    }
    return out;
  }

  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false, doubleClick: 'reset', showTips: false };

  function react(el, traces, lay, says) {
    el.setAttribute('role', 'img');
    el.setAttribute('aria-label', says);
    return Plotly.react(el, traces, lay, CONFIG);
  }

  /** On paper there is less room for words. */
  const narrow = (el, px) => el.clientWidth > 0 && el.clientWidth < px;

  /** Where a touch is found again. */
  function source(view, i) {
    const t = view.touches;
    return `${view.study.runs[t.run[i] - 1]?.log ?? 'log'}:${t.line[i]}`;
  }

  function about(view, i) {
    const t = view.touches;
    const pose = Object.keys(t.axes).filter((a) => 'ABC'.includes(a)).map((a) => `${a}${digits(t.axes[a][i])}°`).join(' ');
    return safe(`touch ${t.id[i]}, ${t.words[t.block[i]]} ${t.words[t.face[i]]}, ${pose}, ${source(view, i)}`);
  }

  function column(view, id) {
    const t = view.touches;
    switch (id) {
      case 'time': return t.time_h;
      case 'order': return t.id.map((_, i) => i + 1);
      case 'approach': return t.approach_deg;
      case 'stylus': return t.stylus_mm;
      default: return t.axes[id];
    }
  }

  const inkOf = (ink, el) => OKABE[ink] ?? colours(el)[ink];
  const penOf = (pen, el) => ({ color: inkOf(pen.ink, el), width: pen.width, dash: pen.dash });
  const lines = (text) => safe(text).replaceAll('\n', '<br>');

  function marker(look, el) {
    const open = look.filled || look.shape === 'cross' || look.shape === 'tick' ? '' : '-open';
    return { symbol: SYMBOL[look.shape] + open, size: 1.3 * look.size, color: inkOf(look.ink, el), opacity: look.opacity, line: { width: look.filled ? 0 : look.size > 5 ? 2 : 1, color: inkOf(look.ink, el) } };
  }

  /** A long name in several lines. */
  const inLines = (name, most) => name.split(' ').reduce((all, word) => {
    const last = all.at(-1);
    return last !== undefined && last.length + word.length < most ? [...all.slice(0, -1), `${last} ${word}`] : [...all, word];
  }, []).join('\n');

  /** An axis of the layout: names at whole numbers, powers of ten, or numbers; where there is little room fewer and smaller ones. */
  function axisOf(axis, isX, chart, el, free) {
    const small = narrow(el, 260);
    // names at the left take their room, too
    const beside = isX ? 90 + (chart.y.names.length ? 120 : 0) : 60;
    const tight = axis.title.length * 7 > (isX ? el.clientWidth : el.clientHeight) - beside;
    const title = { text: lines(tight ? axis.short : axis.title).replace(/, deg$/, ', °'), ...(small ? { font: { size: 10 } } : {}) };
    if (small && isX) title.text = title.text.replace(' about ', '<br>about ');
    const out = { title, zeroline: !(isX && (free || axis.range[0] >= 0)), ...(small ? { nticks: 5, tickfont: { size: 9 }, ...(isX ? { tickangle: 0 } : {}) } : {}) };
    const [low, high] = axis.range;
    if (axis.names.length) {
      const most = narrow(el, 450) ? 24 : 44;
      return { ...out, tickvals: axis.names.map((_, i) => i), ticktext: axis.names.map((name) => lines(name.split('\n').map((line) => inLines(line, most)).join('\n'))), range: !isX && chart.downwards ? [high, low] : [low, high],
        ticks: '', zeroline: false, gridcolor: 'rgba(0,0,0,0)', tickfont: { size: narrow(el, 450) ? 10 : 11 }, ...(isX && axis.names.length > 6 ? { tickangle: -45 } : {}) };
    }
    if (axis.log) {
      const steps = narrow(el, 450) ? [1] : [1, 2, 5];
      return { ...out, type: 'log', tickvals: [-3, -2, -1, 0, 1, 2, 3].flatMap((k) => steps.map((f) => Number((f * 10 ** k).toPrecision(3)))), range: [Math.log10(low), Math.log10(high)] };
    }
    return { ...out, ...(free ? {} : { range: [low, high] }) };
  }

  /** Lines and their names across a chart: of two upright ones each name is on the side away from the other. */
  function rule(mark, isLower, isOneOfTwo, chart, el) {
    const line = { type: 'line', line: penOf(mark.pen, el) };
    const text = { text: safe(mark.series), showarrow: false, font: { size: 11 } };
    if (!mark.upright) {
      return [{ ...line, x0: 0, x1: 1, xref: 'paper', y0: mark.at, y1: mark.at }, { ...text, x: 0, xref: 'paper', xanchor: 'left', xshift: 4, y: chart.y.log ? Math.log10(mark.at) : mark.at, yanchor: 'top', yshift: -2 }];
    }
    const right = isOneOfTwo ? isLower : mark.at > 0.55 * chart.x.range[1];
    return [{ ...line, x0: mark.at, x1: mark.at, y0: 0, y1: 1, yref: 'paper' }, { ...text, x: mark.at, xanchor: right ? 'right' : 'left', y: 1, yref: 'paper', yanchor: 'bottom' }];
  }

  function area(mark, el) {
    const ends = (name, [from, to]) => (from === null || to === null ? { [`${name}0`]: 0, [`${name}1`]: 1, [`${name}ref`]: 'paper' } : { [`${name}0`]: from, [`${name}1`]: to });
    return { type: 'rect', ...ends('x', mark.x), ...ends('y', mark.y), fillcolor: inkOf(mark.ink, el), opacity: mark.opacity, line: { width: 0 }, layer: 'between' };
  }

  /** The residuals of a mark, against the chart's variable; options: from, to (rungs), directions (which of 0 1 2). */
  function touches(el, chart, mark, view, options) {
    const t = view.touches;
    const isAlong = mark.direction === null;
    const { from, to } = options;
    const isAfter = mark.model === 'after';
    if ((!isAfter && from === to) || !(isAlong || options.directions.has(mark.direction))) return [];
    const x = column(view, chart.x.variable);
    const kept = t.id.map((_, i) => i).filter((i) => t.rejected[i] === null && x[i] !== null && (isAlong || t.towards[i] === mark.direction));
    const residual = t.residual_um[isAfter ? to : from];
    const word = isAfter ? (from === to ? 'residual' : 'after') : 'before';
    return [{ type: t.n > MANY ? 'scattergl' : 'scatter', mode: 'markers', x: kept.map((i) => x[i]), y: kept.map((i) => (isAlong ? 1 : t.sign[i]) * residual[i]), customdata: kept,
      marker: marker(mark.look, el), text: kept.map((i) => about(view, i)), hovertemplate: `%{text}<br>${word}: %{y:.2f} µm<extra></extra>` }];
  }

  function added(el, chart, mark, view, options) {
    const direction = mark.direction === null ? 'normal' : 'XYZ'[mark.direction];
    if (mark.direction !== null && !options.directions.has(mark.direction)) return [];
    return view.curves.filter((k) => k.variable === chart.x.variable && k.direction === direction && k.from === options.from && k.to === options.to)
      .map((k) => ({ type: 'scatter', mode: 'lines', x: k.x, y: k.y_um, line: penOf(mark.pen, el), hovertemplate: `the added effect: %{y:.2f} µm<extra>${direction}</extra>` }));
  }

  /** What one mark of a chart is for Plotly: traces, or a shape, an annotation. */
  function traces(el, chart, mark, view, options) {
    const named = { name: safe(mark.series), showlegend: Boolean(mark.series) };
    const value = chart.y.names.length ? 'x' : 'y';
    switch (mark.mark) {
      case 'points':
        return [{ type: 'scatter', mode: 'markers', x: mark.points.map((p) => p.x), y: mark.points.map((p) => p.y), marker: marker(mark.look, el), cliponaxis: false, ...named,
          text: mark.points.map((p) => safe(p.note ?? '')), hovertemplate: `%{text} %{${value}:.3g} µm<extra>${named.name}</extra>` }];
      case 'line':
        return [{ type: 'scatter', mode: 'lines', x: mark.points.map((p) => p.x), y: mark.points.map((p) => p.y), line: penOf(mark.pen, el), hoverinfo: 'skip', ...named }];
      case 'word':
        return [{ type: 'scatter', mode: 'text', x: [mark.at[0]], y: [mark.at[1]], text: [`\u2002${safe(mark.text)}`], textposition: 'top right', cliponaxis: false, hoverinfo: 'skip', showlegend: false }];
      case 'cells':
        return [{ type: 'heatmap', z: mark.rows, zmin: -1, zmax: 1, xgap: 1, ygap: 1,
          // blue to red over the paper: also for colour-blind people
          colorscale: [[0, OKABE.blue], [0.5, colours(el).paper], [1, OKABE.red]], colorbar: { title: { text: 'correlation' }, thickness: 12, tickvals: [-1, -0.5, 0, 0.5, 1] },
          text: mark.rows.map((row) => row.map((r) => (r === null ? '' : r.toFixed(2).replace('-0.00', '0.00').replace('-', '−')))), texttemplate: mark.rows.length <= 12 ? '%{text}' : '',
          customdata: mark.rows.map((row, i) => row.map((_, k) => `${safe(chart.y.names[i])} and ${safe(chart.x.names[k])}`)), hovertemplate: '%{customdata}: %{z:.2f}<extra></extra>' }];
      case 'touches': return touches(el, chart, mark, view, options);
      case 'added': return added(el, chart, mark, view, options);
      default: return [];
    }
  }

  /**
   * Draws a chart. options: of residuals from, to (rungs) and directions; of a picture rung, and flat (drawn without a graphics card).
   */
  function draw(el, chart, view, options = {}) {
    if (chart.picture) return picture(el, chart, view, options);
    const chosen = { from: view.errors.before, to: view.errors.after, directions: new Set([0, 1, 2]), ...options };
    const of = (kind) => chart.marks.filter((m) => m.mark === kind);
    const rules = of('rule').map((m, i, all) => rule(m, all.some((o, k) => o.at > m.at || (o.at === m.at && k > i)), all.length > 1, chart, el));
    const small = narrow(el, 450);
    const isOfTouches = of('touches').length > 0;
    const legend = !chart.legend ? {} : small && chart.downwards ? { y: -0.42, yanchor: 'top', font: { size: 10 } } : { y: chart.downwards ? 1.12 : 1.02, yanchor: 'bottom' };
    const above = chart.legend ? (small ? (chart.downwards ? 22 : 34) : chart.downwards ? 50 : 44) : rules.length ? 26 : 8;
    const tiny = isOfTouches && narrow(el, 260);
    const lay = layout(el, {
      showlegend: chart.legend, legend: { orientation: 'h', x: 0, ...legend }, hovermode: 'closest',
      margin: tiny ? { l: 4, r: 6, t: 4, b: 46 } : { l: 8, r: 14, t: above, b: chart.legend && small && chart.downwards ? 76 : 44 },
      xaxis: axisOf(chart.x, true, chart, el, isOfTouches), yaxis: axisOf(chart.y, false, chart, el, isOfTouches),
      shapes: [...of('area').map((m) => area(m, el)), ...rules.map(([line]) => line)], annotations: rules.map(([, text]) => text),
    });
    const label = (rung) => view.ladder[rung].label;
    const models = !isOfTouches ? '' : chosen.from === chosen.to ? ` Model: ${label(chosen.to)}.` : ` Before: ${label(chosen.from)}; after: ${label(chosen.to)}.`;
    return react(el, chart.marks.flatMap((m) => traces(el, chart, m, view, chosen)), lay, chart.says + models);
  }

  // ---------------------------------------------------------------- in space
  let webgl;
  function hasWebgl() {
    if (webgl === undefined) {
      try {
        webgl = Boolean(document.createElement('canvas').getContext('webgl'));
      } catch {
        webgl = false;
      }
    }
    return webgl;
  }

  /** More arrows than this have no heads: they would take too long. */
  const MOST_HEADS = 2500;
  const sum = (a, b, k = 1) => a.map((v, i) => v + k * b[i]);

  /** The heads of arrows: cones whose point is the arrow's end. */
  function arrowHeads(view, rung, which, tips, times, colour, chart) {
    const t = view.touches;
    // a third of its arrow, at most
    const size = which.map((i) => Math.min((Math.abs(t.residual_um[rung][i]) / 1000) * times / 2.5, 0.04 * chart.picture.extent));
    const of = (k) => tips.map((p) => p[k]);
    const along = (k) => which.map((i, n) => size[n] * t.normal[i][k] * Math.sign(t.residual_um[rung][i]));
    return {
      type: 'cone', x: of(0), y: of(1), z: of(2), u: along(0), v: along(1), w: along(2), anchor: 'tip', sizemode: 'raw', sizeref: 1,
      colorscale: [[0, colour], [1, colour]], showscale: false, showlegend: false, hoverinfo: 'skip',
    };
  }

  function picture(el, chart, view, options) {
    const c = colours(el);
    const t = view.touches;
    const rung = options.rung ?? view.errors.before;
    const { centre, extent, foot, scales } = chart.picture;
    const { times, bar_um: bar } = scales[rung];
    const flat = options.flat || !hasWebgl();
    // seen from the front, right, above: X to the right, Z up
    const [ca, sa, ce, se] = [Math.cos(-0.6), Math.sin(-0.6), Math.cos(0.5), Math.sin(0.5)];
    const map = flat ? (p) => [ca * p[0] - sa * p[1], ce * p[2] + se * (sa * p[0] + ca * p[1])] : (p) => p;
    const trace = (points, more) => {
      const [x, y, z] = [0, 1, 2].map((k) => points.map((p) => (p ? map(p)[k] : null)));
      return { type: flat ? 'scatter' : 'scatter3d', x, y, ...(flat ? {} : { z }), hoverinfo: 'skip', showlegend: false, ...more };
    };
    const wire = (polylines, pen, more = {}) => trace(polylines.flatMap((l) => [...l, null]), { mode: 'lines', line: { ...penOf(pen, el), width: (flat ? 0.75 : 1.6) * pen.width }, ...more });
    const word = (text, at) => trace([at], { mode: 'text', text: [`<b>${safe(text)}</b>`], textfont: { size: 14, color: c.ink } });
    const kept = (stage) => t.id.map((_, i) => i).filter((i) => t.stage[i] === stage && t.rejected[i] === null);
    const arrows = (m) => {
      const which = kept(m.stage);
      const tips = which.map((i) => sum(t.point[i], t.normal[i], (t.residual_um[rung][i] / 1000) * times));
      const group = { legendgroup: m.series };
      const heads = !flat && tips.length <= MOST_HEADS;
      return [
        wire(which.map((i, k) => [t.point[i], tips[k]]), m.pen, { name: safe(m.series), showlegend: true, ...group }),
        ...(heads ? [{ ...arrowHeads(view, rung, which, tips, times, inkOf(m.pen.ink, el), chart), ...group }] : []),
        // what is pointed at; seen only where there are no heads
        trace(tips, { mode: 'markers', marker: { size: flat ? 5 : 4, color: inkOf(m.pen.ink, el), symbol: 'diamond', opacity: heads ? 0 : 1 }, ...group, customdata: which, hoverinfo: undefined,
          text: which.map((i) => `${about(view, i)}<br>residual ${digits(t.residual_um[rung][i])} µm`), hovertemplate: '%{text}<extra></extra>' }),
      ];
    };
    const unused = (m) => {
      const which = t.rejected.flatMap((r, i) => (r === null ? [] : [i]));
      return which.length ? [trace(which.map((i) => t.point[i]), { mode: 'markers', marker: { symbol: 'x', size: flat ? 9 : 5, color: inkOf(m.look.ink, el) }, name: safe(m.series), showlegend: true, hoverinfo: undefined, text: which.map((i) => about(view, i)), hovertemplate: '%{text}: not used<extra></extra>' })] : [];
    };
    const draws = { wire: (m) => [wire(m.lines, m.pen)], name: (m) => [word(m.text, m.at)], arrows, unused };
    const end = sum(foot, [0, 0, 1], (bar / 1000) * times);
    const all = [...chart.marks.flatMap((m) => draws[m.mark]?.(m) ?? []), wire([[foot, end]], { ink: 'ink', width: 5, dash: 'solid' }), word(`${digits(bar, 1)} µm`, end)];
    const common = { margin: { l: 0, r: 0, t: 4, b: 4 }, showlegend: true, legend: { title: { text: document.documentElement.classList.contains('printing') ? 'stage' : 'stage (click hides)' }, x: 0, y: 1, bgcolor: 'rgba(0,0,0,0)' } };
    // the touches fill the picture; the table may be cut
    const r = flat ? 1.05 * extent : 0.76 * extent;
    const around = map(centre);
    const off = { visible: false, showgrid: false, zeroline: false };
    const side = (title, k) => ({ title: { text: title }, color: c.ink, gridcolor: c.grid, zerolinecolor: c.grid, backgroundcolor: 'rgba(0,0,0,0)', range: [centre[k] - r, centre[k] + r] });
    const lay = layout(el, flat
      ? { ...common, xaxis: { ...off, range: [around[0] - 1.5 * r, around[0] + 1.5 * r] }, yaxis: { ...off, scaleanchor: 'x', range: [around[1] - 1.2 * r, around[1] + r] } }
      : { ...common, scene: { aspectmode: 'cube', camera: { eye: { x: 1.1, y: -1.47, z: 0.74 }, center: { x: 0, y: 0, z: -0.18 } }, xaxis: side('X, mm', 0), yaxis: side('Y, mm', 1), zaxis: side('Z, mm', 2) } });
    el.dataset.magnification = times;
    return react(el, all, lay, `${chart.says} Model: ${view.ladder[rung].label}; arrows ${times} times as long as the residuals.`);
  }

  return { draw, digits, valued, source, inkOf };
})();
