//! The `axiscal` binary: arguments → command → exit code.

// proofs and fits allocate many small blocks from several threads
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    axiscal::cli::main()
}
