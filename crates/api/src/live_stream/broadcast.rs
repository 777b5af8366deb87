//! Broadcast of lines through one ring: the sender never waits, a slow subscriber loses the oldest lines, and every loss is counted.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// Lines that the ring holds: 8 s at 1 kHz.
const RING_LINES: usize = 8192;
/// Most lines that a subscriber takes at once, which bounds its memory and the time that the ring is locked. Enough for 6 kHz at 25
/// updates per second.
const TAKE_LINES: usize = 256;

/// The latest lines, numbered from the first one sent.
#[derive(Debug, Default)]
struct Ring {
    lines: VecDeque<Arc<str>>,
    /// Number of the oldest line.
    first: u64,
}

impl Ring {
    fn end(&self) -> u64 {
        self.first + self.lines.len() as u64
    }
}

/// Place of a subscriber in the sequence of lines.
#[derive(Debug, Default)]
struct Cursor {
    next: AtomicU64,
    dropped: AtomicU64,
}

impl Cursor {
    /// Lines lost so far, when the oldest line available is `first`.
    fn dropped(&self, first: u64) -> u64 {
        let behind = first.saturating_sub(self.next.load(Ordering::Relaxed));
        self.dropped.load(Ordering::Relaxed) + behind
    }
}

/// A receiver of lines; dropping it ends the subscription.
#[derive(Debug)]
pub struct Subscriber {
    broadcast: Arc<Broadcast>,
    cursor: Arc<Cursor>,
}

/// Locks, ignoring poisoning: lines are complete even if a thread panicked while holding the lock.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Subscriber {
    /// Lines that have arrived, the oldest first, after waiting for at most `timeout`; `None` once the broadcast is closed and all
    /// lines are taken.
    pub fn take(&self, timeout: Duration) -> Option<Vec<Arc<str>>> {
        let cursor = &self.cursor;
        let mut next = cursor.next.load(Ordering::Relaxed);
        let mut ring = lock(&self.broadcast.ring);
        if ring.end() <= next {
            if self.broadcast.closed.load(Ordering::Acquire) {
                return None;
            }
            if timeout.is_zero() {
                return Some(Vec::new());
            }
            let waited = self.broadcast.arrived.wait_timeout(ring, timeout);
            ring = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        if ring.first > next {
            cursor.dropped.fetch_add(ring.first - next, Ordering::Relaxed);
            next = ring.first;
        }
        let from = (next - ring.first) as usize;
        let lines: Vec<_> = ring.lines.iter().skip(from).take(TAKE_LINES).cloned().collect();
        cursor.next.store(next + lines.len() as u64, Ordering::Relaxed);
        Some(lines)
    }

    /// Lines lost because this subscriber was slow.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.cursor.dropped(self.broadcast.first.load(Ordering::Relaxed))
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        let mut cursors = lock(&self.broadcast.cursors);
        self.broadcast.dropped_before.fetch_add(self.dropped(), Ordering::Relaxed);
        cursors.retain(|cursor| !Arc::ptr_eq(cursor, &self.cursor));
    }
}

/// The lines and their subscribers.
#[derive(Debug, Default)]
pub struct Broadcast {
    ring: Mutex<Ring>,
    /// Lines sent while a subscriber held the ring; locked by the sender only.
    late: Mutex<VecDeque<Arc<str>>>,
    arrived: Condvar,
    closed: AtomicBool,
    /// Number of the oldest line in the ring.
    first: AtomicU64,
    cursors: Mutex<Vec<Arc<Cursor>>>,
    /// Lines lost by subscribers that have ended.
    dropped_before: AtomicU64,
    /// The last value of [`Broadcast::dropped`].
    dropped: AtomicU64,
}

impl Broadcast {
    /// A new subscriber, which receives lines from now on.
    #[must_use]
    pub fn subscribe(self: &Arc<Self>) -> Subscriber {
        let cursor = Arc::new(Cursor::default());
        let ring = lock(&self.ring);
        cursor.next.store(ring.end(), Ordering::Relaxed);
        lock(&self.cursors).push(cursor.clone());
        drop(ring);
        Subscriber { broadcast: self.clone(), cursor }
    }

    /// Sends a line to every subscriber; takes the same time for any number of them, and never waits.
    pub fn send(&self, line: String) {
        let mut late = lock(&self.late);
        late.push_back(line.into());
        self.put(&mut late);
    }

    /// Passes on the lines that could not be put into the ring when they were sent.
    pub fn flush(&self) {
        let mut late = lock(&self.late);
        if !late.is_empty() {
            self.put(&mut late);
        }
    }

    fn put(&self, late: &mut VecDeque<Arc<str>>) {
        let mut ring = match self.ring.try_lock() {
            Ok(ring) => ring,
            Err(TryLockError::Poisoned(ring)) => ring.into_inner(),
            // A subscriber holds the ring: these lines follow with the next one.
            Err(TryLockError::WouldBlock) if late.len() < RING_LINES => return,
            Err(TryLockError::WouldBlock) => lock(&self.ring),
        };
        self.append(&mut ring, late);
        drop(ring);
        self.arrived.notify_all();
    }

    fn append(&self, ring: &mut Ring, late: &mut VecDeque<Arc<str>>) {
        ring.lines.append(late);
        let surplus = ring.lines.len().saturating_sub(RING_LINES);
        ring.lines.drain(..surplus);
        ring.first += surplus as u64;
        self.first.store(ring.first, Ordering::Relaxed);
    }

    /// Lines lost by all slow subscribers, those that have ended included. Never waits: while a subscriber comes or goes, the
    /// previous value.
    pub fn dropped(&self) -> u64 {
        let cursors = match self.cursors.try_lock() {
            Ok(cursors) => cursors,
            Err(TryLockError::Poisoned(cursors)) => cursors.into_inner(),
            Err(TryLockError::WouldBlock) => return self.dropped.load(Ordering::Relaxed),
        };
        let first = self.first.load(Ordering::Relaxed);
        let subscribed: u64 = cursors.iter().map(|cursor| cursor.dropped(first)).sum();
        let dropped = subscribed + self.dropped_before.load(Ordering::Relaxed);
        self.dropped.store(dropped, Ordering::Relaxed);
        dropped
    }

    /// Ends the broadcast; lines in the ring can still be taken.
    pub fn close(&self) {
        let mut late = lock(&self.late);
        let mut ring = lock(&self.ring);
        self.append(&mut ring, &mut late);
        self.closed.store(true, Ordering::Release);
        drop(ring);
        self.arrived.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stalled_subscriber_loses_its_oldest_lines_and_they_are_counted() {
        let broadcast = Arc::new(Broadcast::default());
        let (slow, quick) = (broadcast.subscribe(), broadcast.subscribe());
        let mut received = 0;
        for k in 0..RING_LINES + 100 {
            broadcast.send(k.to_string());
            received += quick.take(Duration::ZERO).expect("open").len();
        }
        assert_eq!((received, quick.dropped()), (RING_LINES + 100, 0));
        assert_eq!((slow.dropped(), broadcast.dropped()), (100, 100));
        let kept = slow.take(Duration::ZERO).expect("open");
        assert_eq!((kept.len(), kept.first().map(|l| l.to_string())), (TAKE_LINES, Some("100".to_owned())));
        drop(slow);
        broadcast.send("last".to_owned());
        assert_eq!(broadcast.dropped(), 100);
        broadcast.close();
        assert_eq!(quick.take(Duration::ZERO).map(|l| l.len()), Some(1));
        assert_eq!(quick.take(Duration::ZERO), None);
    }

    #[test]
    fn a_subscriber_that_holds_the_ring_delays_no_sender_and_loses_no_line() {
        let broadcast = Arc::new(Broadcast::default());
        let reader = broadcast.subscribe();
        let held = lock(&broadcast.ring);
        for k in 0..100 {
            // Would wait for ever with an ordinary lock: this thread holds the ring.
            broadcast.send(k.to_string());
        }
        drop(held);
        assert_eq!(reader.take(Duration::ZERO).map(|l| l.len()), Some(0));
        broadcast.flush();
        assert_eq!(reader.take(Duration::ZERO).map(|l| l.len()), Some(100));
        assert_eq!(broadcast.dropped(), 0);
    }

    #[test]
    fn all_lines_of_many_subscribers_arrive_or_are_counted() {
        const LINES: u64 = 50_000;
        let broadcast = Arc::new(Broadcast::default());
        let readers: Vec<_> = (0..8u64)
            .map(|k| {
                let subscriber = broadcast.subscribe();
                std::thread::spawn(move || {
                    let mut received = 0;
                    while let Some(lines) = subscriber.take(Duration::from_millis(5)) {
                        received += lines.len() as u64;
                        std::thread::sleep(Duration::from_millis(k));
                    }
                    (received, subscriber.dropped())
                })
            })
            .collect();
        (0..LINES).for_each(|k| broadcast.send(k.to_string()));
        broadcast.close();
        for reader in readers {
            let (received, dropped) = reader.join().expect("no panic");
            assert_eq!(received + dropped, LINES);
        }
    }
}
