// Starts the viewer on what the page says it holds.
import style from './style.css';
import { make } from './dom.js';
import { bindKeys } from './keys.js';
import { Model } from './model.js';
import { Panel } from './panel.js';
import { TileModel } from './tiles.js';
import { Viewer } from './viewer.js';

async function start() {
  document.head.append(make('style', { textContent: style }));
  const message = make('div', { className: 'message', textContent: 'Reading …' });
  message.setAttribute('role', 'status');
  document.body.append(message);
  const state = document.documentElement.dataset;
  const fail = (error) => {
    state.state = 'failed';
    message.className = 'message failed';
    message.setAttribute('role', 'alert');
    message.textContent = `This page cannot show its model: ${error.message ?? error}`;
    if (!message.isConnected) document.body.append(message);
  };
  window.addEventListener('error', (event) => fail(event.error ?? event));
  window.addEventListener('unhandledrejection', (event) => fail(event.reason));
  const description = JSON.parse(document.getElementById('lamina').textContent);
  try {
    const viewer = new Viewer(description);
    viewer.start(description.kind === 'tiles' ? await TileModel.load(description, viewer.stage) : await Model.load(description));
    const panel = new Panel(viewer);
    viewer.stage.setCovered(panel.covers);
    viewer.controls.home();
    bindKeys(viewer, panel);
    viewer.stage.canvas.setAttribute('aria-label', `${description.title}, in three dimensions`);
    viewer.stage.canvas.focus();
    message.remove();
    state.state = 'shown';
  } catch (error) {
    fail(error);
    throw error;
  }
}

start();
