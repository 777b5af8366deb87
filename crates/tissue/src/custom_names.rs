//! Interned names and definitions with static lifetime: equal ones are stored once.

use alloc::boxed::Box;
use alloc::string::String;
use once_cell::race::OnceRef;

/// A list that only grows.
pub(crate) struct GrowingList<T: 'static> {
    first: OnceRef<'static, Entry<T>>,
}

struct Entry<T: 'static> {
    value: T,
    next: OnceRef<'static, Entry<T>>,
}

impl<T> GrowingList<T> {
    pub(crate) const fn new() -> Self {
        Self { first: OnceRef::new() }
    }

    /// All entries, oldest first.
    pub(crate) fn iter(&'static self) -> impl Iterator<Item = &'static T> {
        core::iter::successors(self.first.get(), |entry| entry.next.get()).map(|entry| &entry.value)
    }

    /// The first entry that `is_it` accepts; if there is none, a new one from `make`.
    ///
    /// # Errors
    /// That of `make`.
    pub(crate) fn find_or_add<E>(
        &'static self,
        is_it: impl Fn(&T) -> bool,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<&'static T, E> {
        let mut slot = &self.first;
        while let Some(entry) = slot.get() {
            if is_it(&entry.value) {
                return Ok(&entry.value);
            }
            slot = &entry.next;
        }
        let new: &'static Entry<T> = Box::leak(Box::new(Entry { value: make()?, next: OnceRef::new() }));
        // If another thread was faster, append behind its entry.
        while slot.set(new).is_err() {
            if let Some(entry) = slot.get() {
                slot = &entry.next;
            }
        }
        Ok(&new.value)
    }
}

static NAMES: GrowingList<String> = GrowingList::new();

/// The name with static lifetime.
pub(crate) fn static_name(name: &str) -> &'static str {
    let made = NAMES.find_or_add(|known| known == name, || Ok::<_, core::convert::Infallible>(name.into()));
    match made {
        Ok(name) => name,
    }
}
