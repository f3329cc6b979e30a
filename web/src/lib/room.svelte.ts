// How much room the page has.

const query = matchMedia('(min-width: 1000px)');

/** `wide`: what is stands beside what is asked, else above it. As the style sheets have it. */
export const room = $state({ wide: query.matches });

query.addEventListener('change', () => (room.wide = query.matches));
