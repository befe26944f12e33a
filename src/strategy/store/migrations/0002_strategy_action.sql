CREATE TABLE strategy_action (
    strategy_id VARCHAR(128) NOT NULL,
    place BIGINT NOT NULL,
    subject VARCHAR(16) NOT NULL,
    verb VARCHAR(32) NOT NULL,
    PRIMARY KEY (strategy_id, place),
    FOREIGN KEY (strategy_id) REFERENCES strategy (id) ON DELETE CASCADE
)
