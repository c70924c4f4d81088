#include "tests/attack/command_lines.h"

namespace invgrad {
namespace {

std::string LongName() { return std::string(300, 'n'); }

std::string Argument(const std::string& flag, const std::string& value) {
  return "'--" + flag + "=" + value + "'";
}

std::vector<CommandLineRow> MakeRows() {
  return {
      // Folders.
      {"mkdir d; touch d/flags.txt d/keep",
       "$C --overwrite --output=d",
       1,
       "d"},
      {"touch flags.txt keep", "$C --overwrite --output=.", 1, "."},
      {"mkdir d; touch flags.txt keep",
       "$C --overwrite --output=d/..",
       1,
       "d/.."},
      {"touch o", "$C --output=o", 1, "o: Not a directory"},
      {"touch o", "$C --output=o/p", 1, "o/p"},
      {"ln -s o o", "$C --output=o", 1, "o"},
      {"ln -s o o", "$C --output=o/p", 1, "o/p"},
      {"", "$C " + Argument("output", LongName()), 1, "File name too long"},
      {"", "$C --output=/proc/none", 1, "/proc/none"},
      {"mkdir o; touch o/keep", "$C --output=o", 1, "--output=o"},
      {"mkdir o; touch o/keep", "$C --output=o --resume", 1, "o"},
      {"mkdir o; mkfifo o/flags.txt", "$C --output=o --resume", 1, "flags.txt"},
      {"mkdir o; mkfifo o/flags.txt",
       "$C --output=o --overwrite",
       1,
       "flags.txt"},
      {"mkdir o; ln -s /dev/zero o/flags.txt",
       "$C --output=o --resume",
       1,
       "flags.txt"},
      {"mkdir o; ln -s flags.txt o/flags.txt",
       "$C --output=o --resume",
       1,
       "flags.txt"},
      {"mkdir -p o/flags.txt", "$C --output=o --resume", 1, "flags.txt"},
      {"mkdir o; truncate -s 6G o/flags.txt",
       "$C --output=o --resume",
       1,
       "flags.txt"},
      {"$C --output=o; rm o/adam-seed1/result.txt; "
       "mkfifo o/adam-seed1/result.txt",
       "$C --output=o --resume",
       3,
       "result.txt"},
      {"$C --output=o; rm o/adam-seed1/result.txt; "
       "truncate -s 6G o/adam-seed1/result.txt",
       "$C --output=o --resume",
       3,
       "result.txt"},
      // Files.
      {"", "$C " + Argument("data", LongName()), 1, "nnn"},
      {"", "$C " + Argument("init_weights", LongName()), 1, "nnn"},
      {"", "$E " + Argument("input", LongName()), 1, "nnn"},
      {"ln -s x.npy x.npy", "$C --data=x.npy", 1, "x.npy"},
      {"ln -s x x", "$E --input=x", 1, "x"},
      {"mkfifo x.npy", "$C --data=x.npy", 1, "x.npy"},
      {"mkfifo x.dat", "$E --input=x.dat", 1, "x.dat"},
      {"truncate -s 6G x.npy", "$C --data=x.npy", 1, "x.npy"},
      {"truncate -s 6G x.npy", "$C --init_weights=x.npy", 1, "x.npy"},
      {"truncate -s 6G x.dat", "$E --input=x.dat", 1, "x.dat"},
      {"truncate -s 6G x.g2o", "$E --input=x.g2o", 1, "x.g2o"},
      {"truncate -s 6G x.txt", "$E --input=x.txt", 1, "x.txt"},
      {"head -c 300M /dev/zero | bzip2 -1 >x.txt.bz2",
       "$E --input=x.txt.bz2",
       1,
       "x.txt.bz2"},
      {"ln -s /dev/zero x.npy", "$C --data=x.npy", 1, "x.npy"},
      {"$C --output=o && cp o/data.npy x.npy && rm -r o && truncate -s -1 "
       "x.npy",
       "$C --data=x.npy",
       1,
       "x.npy"},
      {"touch x.npy", "$C --data=x.npy", 1, "x.npy"},
      {"touch x.g2o", "$E --input=x.g2o", 1, "x.g2o"},
      {"mkdir d", "$E --input=d", 1, "--input"},
      {"mkdir d; cp in.dat d; touch d/META.txt", "$E --input=d", 0, "META.txt"},
      // Runs that are others.
      {"$C --output=p && cp p/data.npy x.npy && "
       "$C --output=o --data=x.npy && "
       "printf '\\x3f' | dd of=x.npy bs=1 seek=150 conv=notrunc",
       "$C --output=o --data=x.npy --steps=4 --resume",
       1,
       "data"},
      {"$C --output=o --steps=0 --epochs=5 --rules=adam:schedule=cosine",
       "$C --output=o --steps=0 --epochs=10 --rules=adam:schedule=cosine "
       "--resume",
       1,
       "budget"},
      {"$C --output=o --steps=4", "$C --output=o --resume", 1, "budget"},
      {"$C --output=o && $C --output=p --seeds=2 && "
       "cp p/adam-seed2/checkpoint o/adam-seed1",
       "$C --output=o --steps=4 --resume",
       3,
       "checkpoint"},
      {"$C --output=o && $C --output=p --seeds=2 && "
       "cp p/adam-seed2/weights.npy o/adam-seed1",
       "$C --output=o --resume",
       3,
       "weights.npy"},
      {"OPENBLAS_CORETYPE=Prescott $C --output=o",
       "$C --output=o --steps=4 --resume",
       1,
       "BLAS kernels",
       "",
       {"OPENBLAS_CORETYPE=Haswell"}},
      {"$C --output=o && echo >>o/files.txt && touch o/keep",
       "$C --output=o --resume",
       0,
       "steps done"},
      // Methods that fail.
      {"", "$E --input=in.dat --methods=adam:step_size=1e300", 3, "failed"},
      {"", "$C --rules=adam,supervised --output=o", 2, "supervised"},
      {"", "$C --rules=supervised --output=o", 3, "supervised"},
      // Numbers.
      {"", "$C --blas_threads=2147483648", 1, "blas_threads"},
      {"", "$C --steps=-1", 1, "--steps=-1"},
      {"", "$C --seconds=nan", 1, "--seconds=nan"},
      {"", "$C --seeds=1..", 1, "--seeds"},
      {"", "$C --seeds=2147483648", 1, "out of the range"},
      {"", "trajectories --steps=2147483647 --plots=false", 1, "--steps"},
      {"", "trajectories --grid=2147483647 --plots=false", 1, "--grid"},
      {"", "sweep --grid=rule=adam;seed=1..20000", 1, "--grid"},
      {"", "proposals --rules=nothing", 1, "nothing"},
      // Names.
      {"", "compare --rule=adam", 1, "rule"},
      {"", "compare adam", 1, "adam"},
      {"", "$C --rules=adm", 1, "adam"},
      {"", "$C --rules=adam:step_siz=1", 1, "step_size"},
      {"", "$C --problem=", 1, "--problem"},
      {"", "$C --rules=", 1, "--rules"},
      {"", "$C " + Argument("rules", std::string(100000, 'x')), 1, "--rules"},
      {"", "$C " + Argument("problem", std::string(100000, 'x')), 1, "problem"},
      {"", "$C --rules=\x1b[31mred", 1, "--rules"},
      // Full devices.
      {"", "compare --list", 1, "cannot write the output", "/dev/full"},
      {"",
       "compare --list_markdown=rules",
       1,
       "cannot write the output",
       "/dev/full"},
      {"", "estimate --list", 1, "cannot write the output", "/dev/full"},
      {"", "proposals --help", 1, "cannot write the output", "/dev/full"},
  };
}

std::vector<std::string> MakeGarbage() {
  return {"",
          " ",
          "x",
          "-1",
          "0",
          "-2147483649",
          "2147483648",
          "9223372036854775807",
          "9223372036854775808",
          "1e300",
          "1e-300",
          "nan",
          "inf",
          "-inf",
          "0x10",
          "1,,2",
          "1..",
          "1..1",
          "3..1",
          ",",
          ":",
          "=",
          ";",
          "::=",
          ">",
          "+",
          "|",
          "-",
          "--",
          "%s%n%d",
          "~",
          "$(id)",
          "*",
          ".",
          "/dev/zero",
          "/dev/full",
          "/proc/self/mem",
          "/proc/none/none",
          "adam:",
          "adam>",
          "adam:step_size=",
          "adam:step_size=nan",
          "adam:batch_size=9999999999",
          "ceres_lm+",
          "rule=",
          "rule=adam;rule=adam",
          "rule=adam;seed=-1",
          "toy_network:",
          "toy_network:num_samples=99999999999",
          "toy_network:num_samples=1e6:lambda=inf",
          "\x1b[31mred\x1b[0m",
          "a\nb",
          "a\rb\tc\x07",
          "\xff\xfe",
          "\xe2\x88\x9e",
          std::string(300, 'n'),
          std::string(5000, '/') + "x",
          std::string(100000, 'x'),
          std::string(100000, ','),
          std::string(1000, '1')};
}

}  // namespace

const std::vector<CommandLineRow>& CommandLineRows() {
  static const auto& rows = *new std::vector<CommandLineRow>(MakeRows());
  return rows;
}

const std::vector<SmallRun>& SmallRuns() {
  // Two budgets: whichever a flag replaces, the other ends the run.
  static const auto& runs = *new std::vector<SmallRun>{
      {"compare",
       {"--problem=toy_network:num_samples=16",
        "--rules=adam",
        "--steps=2",
        "--epochs=2",
        "--plots=false",
        "--progress=false",
        "--output=run"},
       ""},
      {"sweep",
       {"--problem=toy_network:num_samples=16",
        "--grid=rule=adam",
        "--steps=2",
        "--epochs=2",
        "--plots=false",
        "--progress=false",
        "--output=run"},
       ""},
      {"estimate",
       {"--input=in.dat",
        "--methods=ceres_lm",
        "--max_iterations=2",
        "--seconds=2",
        "--plots=false",
        "--progress=false",
        "--output=run"},
       "in.dat"},
      {"trajectories",
       {"--steps=2", "--grid=5", "--plots=false", "--output=run"},
       ""},
      {"proposals", {"--rules=half_inverse"}, ""},
  };
  return runs;
}

const std::vector<std::string>& GarbageValues() {
  static const auto& values = *new std::vector<std::string>(MakeGarbage());
  return values;
}

}  // namespace invgrad
