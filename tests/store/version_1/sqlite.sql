BEGIN TRANSACTION;
CREATE TABLE batches (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, client TEXT NOT NULL, created REAL NOT NULL, total INTEGER NOT NULL
) STRICT;
INSERT INTO "batches" VALUES('batch','solve','alice',1.79520526559413385386e+09,4);
CREATE TABLE bodies (id TEXT PRIMARY KEY, status TEXT NOT NULL, body BLOB NOT NULL) STRICT;
INSERT INTO "bodies" VALUES('answered','successful',X'7B2276657264696374223A2022766172696174696F6E616C227D');
INSERT INTO "bodies" VALUES('failed','failed',X'7B22737461747573223A203432322C202264657461696C223A20226E6F227D');
CREATE TABLE counters (name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT;
INSERT INTO "counters" VALUES('order',3);
CREATE TABLE events (
    id TEXT NOT NULL, number INTEGER NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL,
    PRIMARY KEY (id, number)
) STRICT, WITHOUT ROWID;
INSERT INTO "events" VALUES('answered',1,'status','{"status": "running"}');
CREATE TABLE jobs (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    kind TEXT NOT NULL,
    document TEXT NOT NULL,
    options TEXT NOT NULL,
    status TEXT NOT NULL,
    client TEXT NOT NULL,
    priority INTEGER NOT NULL,
    created REAL NOT NULL,
    started REAL,
    finished REAL,
    attempt INTEGER NOT NULL DEFAULT 0,
    crashes INTEGER NOT NULL DEFAULT 0,
    restarts INTEGER NOT NULL DEFAULT 0,
    revision INTEGER NOT NULL DEFAULT 0,
    owner TEXT,
    heartbeat REAL,
    order_number INTEGER,
    wall REAL NOT NULL DEFAULT 0,
    cpu REAL NOT NULL DEFAULT 0,
    memory REAL NOT NULL DEFAULT 0
) STRICT;
INSERT INTO "jobs" VALUES(1,'answered','solve','{"name": "answered"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','successful','alice',0,1.79520526550623512273e+09,1.79520526551392197605e+09,1.7952052655141811371e+09,1,0,0,1,NULL,1.79520526551392197605e+09,NULL,1.0,0.5,64.0);
INSERT INTO "jobs" VALUES(2,'failed','solve','{"name": "failed"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','failed','bob',0,1.7952052655217673779e+09,1.79520526553378129003e+09,1.79520526553393864636e+09,1,0,0,1,NULL,1.79520526553378129003e+09,NULL,0.0,0.0,0.0);
INSERT INTO "jobs" VALUES(3,'cancelled','solve','{"name": "cancelled"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','dismissed','bob',0,1.79520526554831862447e+09,NULL,1.79520526555668354031e+09,0,0,0,0,NULL,NULL,NULL,0.0,0.0,0.0);
INSERT INTO "jobs" VALUES(4,'running','solve','{"name": "running"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','running','alice',0,1.79520526556984496117e+09,1.79520526558973860745e+09,NULL,1,0,0,0,'o',1.79520526558973860745e+09,NULL,0.0,0.0,0.0);
INSERT INTO "jobs" VALUES(5,'waiting','solve','{"name": "waiting"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','accepted','bob',0,1.79520526558992195124e+09,NULL,NULL,0,0,0,0,NULL,NULL,NULL,0.0,0.0,0.0);
INSERT INTO "jobs" VALUES(6,'line','solve','{"name": "line"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','accepted','alice',10,1.79520526559408617021e+09,NULL,NULL,0,0,0,0,NULL,NULL,NULL,0.0,0.0,0.0);
INSERT INTO "jobs" VALUES(7,'gone','solve','{"name": "gone"}','{"memory_limit":4096,"seed":1,"time_limit":60.0}','dismissed','alice',10,1.79520526559411406513e+09,NULL,1.79520526559769320485e+09,0,0,0,0,NULL,NULL,NULL,0.0,0.0,0.0);
CREATE TABLE lines (
    batch TEXT NOT NULL, number INTEGER NOT NULL, identifier TEXT NOT NULL, job TEXT, problem BLOB,
    order_number INTEGER,
    PRIMARY KEY (batch, number)
) STRICT, WITHOUT ROWID;
INSERT INTO "lines" VALUES('batch',1,'"a"','answered',NULL,1);
INSERT INTO "lines" VALUES('batch',2,'"b"','line',NULL,NULL);
INSERT INTO "lines" VALUES('batch',3,'"c"','gone',NULL,3);
INSERT INTO "lines" VALUES('batch',4,'4',NULL,X'7B22737461747573223A203432322C202264657461696C223A2022626164227D',2);
CREATE INDEX jobs_waiting ON jobs (priority, sequence) WHERE status = 'accepted';
CREATE INDEX jobs_open ON jobs (client, status) WHERE status IN ('accepted', 'running');
CREATE INDEX jobs_finished ON jobs (finished) WHERE status NOT IN ('accepted', 'running');
CREATE INDEX jobs_status ON jobs (status, sequence);
CREATE INDEX lines_of_job ON lines (job, order_number);
CREATE INDEX lines_in_order ON lines (batch, order_number);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('jobs',7);
COMMIT;
PRAGMA user_version = 1;
