//! The states of a forest between its joins, so that a copy knows whether it is an earlier state of another forest.

use std::collections::VecDeque;

use crate::arrays::State;

/// How many earlier states are known.
const KNOWN: usize = 64;

/// The state of a forest, and those before it.
#[derive(Debug)]
pub(crate) struct History {
    now: State,
    /// Whether nothing has changed since the join.
    is_complete: bool,
    before: VecDeque<State>,
}

impl History {
    pub(crate) fn new() -> Self {
        Self {
            now: State::next(),
            is_complete: false,
            before: VecDeque::new(),
        }
    }

    /// Begins or continues a change. Returns the state that it leads to.
    pub(crate) fn edit(&mut self) -> State {
        if self.is_complete {
            if self.before.len() == KNOWN {
                self.before.pop_front();
            }
            self.before.push_back(self.now);
            self.now = State::next();
            self.is_complete = false;
        }
        self.now
    }

    /// Ends a change.
    pub(crate) fn complete(&mut self) {
        self.is_complete = true;
    }

    /// The state of this forest, if the other one has been in it.
    pub(crate) fn is_part_of(&self, other: &Self) -> Option<State> {
        let is_known = self.now == other.now || other.before.contains(&self.now);
        (is_known && self.is_complete && other.is_complete).then_some(self.now)
    }
}

/// Two copies of a forest that is being changed may change in different ways: the copy gets a state of its own.
impl Clone for History {
    fn clone(&self) -> Self {
        Self {
            now: if self.is_complete {
                self.now
            } else {
                State::next()
            },
            is_complete: self.is_complete,
            before: self.before.clone(),
        }
    }
}
