// Which instruction-set variant of the hot code runs. Chosen once, at run time; the environment
// variable TRAJOPT_ISA=portable|avx2|avx512 lowers it, for tests and for comparing bits.
#pragma once

namespace trajopt {

enum class Isa { portable, avx2, avx512 };

Isa best_isa();    // what this machine can run
Isa active_isa();  // what runs
const char* isa_name(Isa isa);

}  // namespace trajopt
