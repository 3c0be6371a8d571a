// the kinds of traces that the plots use (scattergl without generated code, so that pages may forbid it)
const Plotly = require('plotly.js/lib/core');
Plotly.register([
  require('plotly.js/lib/bar'),
  require('plotly.js/lib/cone'),
  require('plotly.js/lib/heatmap'),
  require('plotly.js/lib/mesh3d'),
  require('plotly.js/lib/scatter3d'),
  require('plotly.js/src/traces/scattergl/strict'),
]);
module.exports = Plotly;
