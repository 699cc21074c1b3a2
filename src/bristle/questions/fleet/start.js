"use strict";
(async () => {
  for (const part of document.querySelectorAll(".unscripted")) part.hidden = true;
  await fleet.charts.start();
  for (const part of [fleet.joints, fleet.units, fleet.quality]) part.start();
  addEventListener("click", (event) => {
    const link = event.target.closest?.('a[href^="#warning-"]'), entry = link && fleet.element(link.hash.slice(1));
    if (entry) entry.closest("details").open = true;
  });
  document.documentElement.dataset.ready = "yes";
})();
