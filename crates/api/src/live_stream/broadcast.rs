//! Broadcast of lines to subscribers, each with its own ring: the sender never waits, a slow subscriber loses the oldest lines.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// Lines that a ring holds: 8 s at 1 kHz.
const RING_LINES: usize = 8192;

/// The ring of one subscriber.
#[derive(Debug, Default)]
pub struct Subscriber {
    lines: Mutex<VecDeque<Arc<str>>>,
    /// Lines that arrived while the subscriber held its lock; locked by the sender only.
    late: Mutex<VecDeque<Arc<str>>>,
    arrived: Condvar,
    dropped: AtomicU64,
    unsubscribed: AtomicBool,
    closed: AtomicBool,
}

/// A thread that panicked while holding the lock left whole lines behind.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Subscriber {
    /// Never waits: while the subscriber holds its lock, lines are kept apart.
    fn send(&self, line: &Arc<str>) {
        let mut late = lock(&self.late);
        late.push_back(line.clone());
        let mut lines = match self.lines.try_lock() {
            Ok(lines) => lines,
            Err(TryLockError::Poisoned(lines)) => lines.into_inner(),
            Err(TryLockError::WouldBlock) => return self.drop_oldest(&mut late),
        };
        lines.append(&mut late);
        self.drop_oldest(&mut lines);
        drop(lines);
        self.arrived.notify_one();
    }

    fn drop_oldest(&self, lines: &mut VecDeque<Arc<str>>) {
        while lines.len() > RING_LINES {
            lines.pop_front();
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// All lines that have arrived, after waiting for at most `timeout`; `None` once the broadcast is closed.
    pub fn take(&self, timeout: Duration) -> Option<VecDeque<Arc<str>>> {
        let mut lines = lock(&self.lines);
        if lines.is_empty() {
            if self.closed.load(Ordering::Acquire) {
                return None;
            }
            lines = self.arrived.wait_timeout(lines, timeout).unwrap_or_else(PoisonError::into_inner).0;
        }
        Some(std::mem::take(&mut *lines))
    }

    /// Lines lost because this subscriber was slow.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Ends the subscription.
    pub fn unsubscribe(&self) {
        self.unsubscribed.store(true, Ordering::Release);
    }
}

/// All subscribers.
#[derive(Debug, Default)]
pub struct Broadcast {
    subscribers: Mutex<Vec<Arc<Subscriber>>>,
    dropped_by_unsubscribed: AtomicU64,
}

impl Broadcast {
    /// A new subscriber, which receives lines from now on.
    pub fn subscribe(&self) -> Arc<Subscriber> {
        let subscriber = Arc::new(Subscriber::default());
        lock(&self.subscribers).push(subscriber.clone());
        subscriber
    }

    /// Sends a line to every subscriber.
    pub fn send(&self, line: String) {
        let line: Arc<str> = line.into();
        lock(&self.subscribers).retain(|subscriber| {
            if subscriber.unsubscribed.load(Ordering::Acquire) {
                self.dropped_by_unsubscribed.fetch_add(subscriber.dropped(), Ordering::Relaxed);
                return false;
            }
            subscriber.send(&line);
            true
        });
    }

    /// Lines lost by all slow subscribers.
    pub fn dropped(&self) -> u64 {
        let subscribed: u64 = lock(&self.subscribers).iter().map(|s| s.dropped()).sum();
        self.dropped_by_unsubscribed.load(Ordering::Relaxed) + subscribed
    }

    /// Ends the broadcast.
    pub fn close(&self) {
        for subscriber in lock(&self.subscribers).iter() {
            let mut late = lock(&subscriber.late);
            lock(&subscriber.lines).append(&mut late);
            subscriber.closed.store(true, Ordering::Release);
            subscriber.arrived.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stalled_subscriber_loses_its_oldest_lines_and_they_are_counted() {
        let broadcast = Broadcast::default();
        let (slow, quick) = (broadcast.subscribe(), broadcast.subscribe());
        let mut received = 0;
        for k in 0..RING_LINES + 100 {
            broadcast.send(k.to_string());
            received += quick.take(Duration::ZERO).expect("open").len();
        }
        assert_eq!((received, quick.dropped()), (RING_LINES + 100, 0));
        assert_eq!((slow.dropped(), broadcast.dropped()), (100, 100));
        let kept = slow.take(Duration::ZERO).expect("open");
        assert_eq!((kept.len(), kept.front().map(|l| l.to_string())), (RING_LINES, Some("100".to_owned())));
        slow.unsubscribe();
        broadcast.send("last".to_owned());
        assert_eq!(broadcast.dropped(), 100);
        broadcast.close();
        assert_eq!(quick.take(Duration::ZERO).map(|l| l.len()), Some(1));
        assert_eq!(quick.take(Duration::ZERO), None);
    }
}
