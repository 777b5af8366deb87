//! One ring per reader: the core puts in and never waits; a slow reader loses the oldest.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// Lines a reader may be behind: 8 s at 1 kHz.
const BEHIND: usize = 8192;

/// A reader's ring.
#[derive(Debug, Default)]
pub struct Subscriber {
    lines: Mutex<VecDeque<Arc<str>>>,
    /// What came while the reader held its lines; only the core locks it.
    late: Mutex<VecDeque<Arc<str>>>,
    some: Condvar,
    dropped: AtomicU64,
    gone: AtomicBool,
    closed: AtomicBool,
}

impl Subscriber {
    /// Whoever panicked while holding the lock left whole lines behind.
    fn lock(&self) -> MutexGuard<'_, VecDeque<Arc<str>>> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Never waits: while the reader holds its ring, lines stay beside it.
    fn put(&self, line: &Arc<str>) {
        let mut late = self.late.lock().unwrap_or_else(PoisonError::into_inner);
        late.push_back(line.clone());
        let mut lines = match self.lines.try_lock() {
            Ok(lines) => lines,
            Err(TryLockError::Poisoned(lines)) => lines.into_inner(),
            Err(TryLockError::WouldBlock) => return self.keep_few(&mut late),
        };
        lines.append(&mut late);
        self.keep_few(&mut lines);
        drop(lines);
        self.some.notify_one();
    }

    fn keep_few(&self, lines: &mut VecDeque<Arc<str>>) {
        while lines.len() > BEHIND {
            lines.pop_front();
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Everything that has come, waiting for something at most `patience`; `None` when no more will come.
    pub fn take(&self, patience: Duration) -> Option<VecDeque<Arc<str>>> {
        let mut lines = self.lock();
        if lines.is_empty() {
            if self.closed.load(Ordering::Acquire) {
                return None;
            }
            lines = self.some.wait_timeout(lines, patience).unwrap_or_else(PoisonError::into_inner).0;
        }
        // The lock is held for this exchange alone.
        Some(std::mem::take(&mut *lines))
    }

    /// Lines that were lost because this reader was slow.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Nobody reads any more.
    pub fn unsubscribe(&self) {
        self.gone.store(true, Ordering::Release);
    }
}

/// All readers.
#[derive(Debug, Default)]
pub struct Broadcast {
    readers: Mutex<Vec<Arc<Subscriber>>>,
    dropped_by_gone: AtomicU64,
}

impl Broadcast {
    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Subscriber>>> {
        self.readers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A new reader, which hears what comes from now on.
    pub fn subscribe(&self) -> Arc<Subscriber> {
        let reader = Arc::new(Subscriber::default());
        self.lock().push(reader.clone());
        reader
    }

    /// Gives a line to every reader.
    pub fn send(&self, line: String) {
        let line: Arc<str> = line.into();
        self.lock().retain(|reader| {
            if reader.gone.load(Ordering::Acquire) {
                self.dropped_by_gone.fetch_add(reader.dropped(), Ordering::Relaxed);
                return false;
            }
            reader.put(&line);
            true
        });
    }

    /// Lines that slow readers have lost, all together.
    pub fn dropped(&self) -> u64 {
        self.dropped_by_gone.load(Ordering::Relaxed) + self.lock().iter().map(|r| r.dropped()).sum::<u64>()
    }

    /// No more will come.
    pub fn close(&self) {
        for reader in self.lock().iter() {
            let mut late = reader.late.lock().unwrap_or_else(PoisonError::into_inner);
            reader.lock().append(&mut late);
            reader.closed.store(true, Ordering::Release);
            reader.some.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_stalls_loses_the_oldest_and_the_number_is_known() {
        let hub = Broadcast::default();
        let (slow, quick) = (hub.subscribe(), hub.subscribe());
        let mut heard = 0;
        for k in 0..BEHIND + 100 {
            hub.send(k.to_string());
            heard += quick.take(Duration::ZERO).expect("open").len();
        }
        assert_eq!((heard, quick.dropped()), (BEHIND + 100, 0));
        assert_eq!((slow.dropped(), hub.dropped()), (100, 100));
        let left = slow.take(Duration::ZERO).expect("open");
        assert_eq!((left.len(), left.front().map(|l| l.to_string())), (BEHIND, Some("100".to_owned())));
        slow.unsubscribe();
        hub.send("last".to_owned());
        assert_eq!(hub.dropped(), 100);
        hub.close();
        assert_eq!(quick.take(Duration::ZERO).map(|l| l.len()), Some(1));
        assert_eq!(quick.take(Duration::ZERO), None);
    }
}
