//! A bridge between Zenoh and ROS 2: the published plugin `zenoh-plugin-ros2dds`, unmodified, started in this process.
//! `interop_bridge CONFIG.json5`: a configuration of Zenoh, with the plugin's under `plugins/ros2dds`. Ends with SIGINT or SIGTERM.

use std::process::ExitCode;

use tokio::signal::unix::{signal, SignalKind};
use zenoh::internal::plugins::PluginsManager;
use zenoh::internal::runtime::RuntimeBuilder;
use zenoh_plugin_ros2dds::ROS2Plugin;

async fn bridge(path: &str) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut interrupted = signal(SignalKind::interrupt())?;
    let mut terminated = signal(SignalKind::terminate())?;
    let mut plugins = PluginsManager::static_plugins_only();
    plugins.declare_static_plugin::<ROS2Plugin, &str>("ros2dds", true);
    let config = zenoh::Config::from_file(path)?;
    let mut runtime = RuntimeBuilder::new(config).plugins_manager(plugins).build().await?;
    runtime.start().await?;
    tokio::select! {
        _ = interrupted.recv() => {}
        _ = terminated.recv() => {}
    }
    Ok(())
}

fn main() -> ExitCode {
    let Some(path) = std::env::args().nth(1) else {
        eprintln!("usage: interop_bridge CONFIG.json5");
        return ExitCode::from(2);
    };
    zenoh::init_log_from_env_or("error");
    // The plugin's tasks run on the runtime of the thread that starts it.
    let ended = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Into::into)
        .and_then(|runtime| runtime.block_on(bridge(&path)));
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("interop_bridge: {error}");
            ExitCode::FAILURE
        }
    }
}
