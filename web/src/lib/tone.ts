// Tones of the displayed states. The text of a state always has the same meaning as the tone of the
// state.

/** Colour and shape of a state. Each shape is different, for users who cannot distinguish colours. */
export type Tone = 'off' | 'hold' | 'move' | 'pause' | 'teach' | 'error' | 'lost';

/** Tone of an event. */
export type EventTone = 'info' | 'good' | 'warn' | 'error';
