//! The tool's handshake: a number that grows, and the answer that carries it.

use tandem_msg::{EffectorCommand, EffectorPhase, EffectorState, MotionTask};

/// What became of the command in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    Waiting,
    Done,
    Failed,
}

/// The command in force, repeated every cycle: the tool acts once on each new number.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Effector {
    command: EffectorCommand,
}

impl Effector {
    pub(crate) fn command(&self) -> EffectorCommand {
        self.command
    }

    /// Begins the action of a task, with a number that neither this controller nor one before it has used.
    pub(crate) fn begin(&mut self, task: &MotionTask, state: &EffectorState) {
        self.command = EffectorCommand {
            id: self.command.id.max(state.command_id).wrapping_add(1),
            action: task.action,
            tool: task.tool,
            reserved: 0,
            value: task.value,
        };
    }

    /// Before anything was begun: repeats the number the tool knows, which asks nothing of it.
    pub(crate) fn adopt(&mut self, state: &EffectorState) {
        if self.command.id < state.command_id {
            self.command = EffectorCommand { id: state.command_id, ..EffectorCommand::default() };
        }
    }

    pub(crate) fn answer(&self, state: &EffectorState) -> Answer {
        if state.command_id != self.command.id {
            return Answer::Waiting;
        }
        match state.phase.get() {
            Some(EffectorPhase::Done) => Answer::Done,
            Some(EffectorPhase::Failed) => Answer::Failed,
            _ => Answer::Waiting,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_msg::{Code, EffectorAction};

    /// A controller that starts anew goes on counting where the tool is, and old answers are not taken for new ones.
    #[test]
    fn numbers_go_on_after_a_restart() {
        let task = MotionTask { action: Code::of(EffectorAction::Grasp), ..MotionTask::default() };
        let mut state =
            EffectorState { command_id: 41, phase: Code::of(EffectorPhase::Done), ..EffectorState::default() };
        let mut effector = Effector::default();
        effector.adopt(&state);
        assert_eq!((effector.command().id, effector.command().action), (41, Code::of(EffectorAction::Keep)));
        effector.begin(&task, &state);
        assert_eq!(effector.command().id, 42);
        assert_eq!(effector.answer(&state), Answer::Waiting);
        state.command_id = 42;
        assert_eq!(effector.answer(&state), Answer::Done);
        state.phase = Code::of(EffectorPhase::Failed);
        assert_eq!(effector.answer(&state), Answer::Failed);
    }
}
