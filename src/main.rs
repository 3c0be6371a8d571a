//! The `axiscal` binary: arguments → command → exit code.

// the proof of a program, and a fit, ask for much memory in small pieces from several threads
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    axiscal::cli::main()
}
