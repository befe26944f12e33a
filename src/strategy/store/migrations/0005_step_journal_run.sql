CREATE INDEX step_journal_run ON step_journal (run, seq)
