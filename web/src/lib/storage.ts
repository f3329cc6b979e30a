// Storage of a browser. If the storage is blocked or full, a page still works, but its data is lost when
// the page closes.

export interface Store {
  getItem(name: string): string | null;
  setItem(name: string, value: string): void;
  removeItem(name: string): void;
}

/** Returns the browser's storage. If this storage fails, the page uses a storage in its memory. */
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

/** Storage that is kept on this device. */
export const device = guarded(() => localStorage);
/** Storage that is kept until the tab closes. */
export const tab = guarded(() => sessionStorage);
