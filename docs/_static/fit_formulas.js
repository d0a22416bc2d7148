/* Write formulas that are wider than their place smaller, down to half; what is wider yet scrolls. */
function fitFormulas() {
    for (const place of document.querySelectorAll('div.math')) {
        const formula = place.querySelector('mjx-container');
        if (!formula) continue;
        formula.dataset.size ??= formula.style.fontSize || '100%';
        const size = parseFloat(formula.dataset.size);
        for (let share = 100; share >= 50; share -= 2) {
            formula.style.fontSize = `${(size * share) / 100}%`;
            if (place.scrollWidth <= place.clientWidth) break;
        }
    }
}

addEventListener('load', async () => {
    await MathJax.startup.promise;
    fitFormulas();
    addEventListener('resize', fitFormulas);
});
