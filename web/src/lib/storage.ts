// Storage of a browser. Without it (blocked or full) a page works, and forgets when it closes.

export interface Store {
  getItem(name: string): string | null;
  setItem(name: string, value: string): void;
  removeItem(name: string): void;
}

/** Returns the browser's storage with a fallback of this page, which is used if the browser's fails. */
export function guarded(open: () => Store): Store {
  const own = new Map<string, string>();
  const attempt = <T>(act: (store: Store) => T, instead: T): T => {
    try {
      return act(open());
    } catch {
      return instead;
    }
  };
  return {
    getItem: (name) => own.get(name) ?? attempt((store) => store.getItem(name), null),
    setItem(name, value) {
      const kept = attempt((store) => {
        store.setItem(name, value);
        return true;
      }, false);
      if (kept) own.delete(name);
      else own.set(name, value);
    },
    removeItem(name) {
      own.delete(name);
      attempt((store) => store.removeItem(name), undefined);
    },
  };
}

/** Kept on this device. */
export const device = guarded(() => localStorage);
/** Kept until the tab closes. */
export const tab = guarded(() => sessionStorage);
