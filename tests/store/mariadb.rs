//! A private MariaDB server: own folder, own port on the loopback, gone with its value.

use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A running server; dropping it ends it and removes its folder.
pub(crate) struct Server {
    port: u16,
    process: Child,
    _folder: tempfile::TempDir,
}

impl Server {
    /// Starts a server, or answers `None` where MariaDB is not installed.
    pub(crate) fn start() -> Option<Self> {
        let installed = |program: &str| {
            Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
        };
        // Debian keeps the server where only root's path leads.
        let server = ["mariadbd", "/usr/sbin/mariadbd"].into_iter().find(|program| installed(program))?;
        if !installed("mariadb-install-db") {
            return None;
        }
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = folder.path().join("data");
        // As root the server runs as nobody, who must be able to get there.
        let root = rustix::process::geteuid().is_root();
        std::fs::set_permissions(folder.path(), std::fs::Permissions::from_mode(0o755)).expect("own folder");
        let user: &[&str] = if root { &["--user=nobody"] } else { &[] };
        let made = Command::new("mariadb-install-db")
            .args(["--no-defaults", "--auth-root-authentication-method=normal", "--skip-test-db"])
            .arg(format!("--datadir={}", data.display()))
            .args(user)
            .output()
            .expect("mariadb-install-db runs");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let port = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr()).expect("a free port").port();
        let process = Command::new(server)
            .arg("--no-defaults")
            .args(user)
            .arg(format!("--datadir={}", data.display()))
            .arg(format!("--socket={}", data.join("socket").display()))
            .arg(format!("--pid-file={}", data.join("pid").display()))
            .arg(format!("--port={port}"))
            .args(["--bind-address=127.0.0.1", "--skip-log-bin", "--innodb-buffer-pool-size=64M"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("mariadbd starts");
        let mut started = Self { port, process, _folder: folder };
        started.await_answer(&data);
        Some(started)
    }

    fn await_answer(&mut self, data: &Path) {
        let began = Instant::now();
        while TcpStream::connect(("127.0.0.1", self.port)).is_err() {
            if let Ok(Some(status)) = self.process.try_wait() {
                panic!("mariadbd ended with {status}; its data was in {}", data.display());
            }
            assert!(began.elapsed() < Duration::from_secs(60), "mariadbd does not answer on port {}", self.port);
            std::thread::yield_now();
        }
    }

    /// URL of a new, empty database.
    pub(crate) fn database(&self, name: &str) -> String {
        sqlx::any::install_default_drivers();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        runtime.block_on(async {
            let root = format!("mysql://root@127.0.0.1:{}/mysql", self.port);
            let pool = sqlx::AnyPool::connect(&root).await.expect("the private server answers");
            let make = format!("CREATE DATABASE {name}");
            sqlx::query(sqlx::AssertSqlSafe(make)).execute(&pool).await.expect("a new database");
            pool.close().await;
        });
        format!("mysql://root@127.0.0.1:{}/{name}", self.port)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
