# Sets TRAJOPT_WITH_CUDA: whether the CUDA backend is built, from the option TRAJOPT_CUDA and from
# what is installed. When it is, enables the language and chooses the architectures. Sets
# TRAJOPT_WITH_EMULATION: whether its tests on the emulated runtime can be built.
set(TRAJOPT_WITH_CUDA OFF)
set(TRAJOPT_WITH_EMULATION OFF)
if(TRAJOPT_CUDA STREQUAL "OFF")
  return()
endif()
if(NOT TRAJOPT_CUDA MATCHES "^(AUTO|ON|EMULATED)$")
  message(FATAL_ERROR "TRAJOPT_CUDA is '${TRAJOPT_CUDA}', expected AUTO, ON, EMULATED or OFF")
endif()
if(TRAJOPT_CUDA STREQUAL "EMULATED")
  find_package(CUDAToolkit QUIET)
  set(TRAJOPT_WITH_EMULATION ${CUDAToolkit_FOUND})
  if(NOT CUDAToolkit_FOUND)
    message(STATUS "CUDA: no toolkit, whose headers the emulated runtime is compiled with")
  endif()
  return()
endif()

if(NOT CMAKE_CUDA_COMPILER)
  find_program(
    TRAJOPT_NVCC nvcc
    HINTS ENV CUDACXX ENV CUDA_HOME ENV CUDA_PATH
    PATHS /usr/local/cuda /opt/cuda
    PATH_SUFFIXES bin
    DOC "The CUDA compiler")
  if(TRAJOPT_NVCC)
    set(CMAKE_CUDA_COMPILER ${TRAJOPT_NVCC})
  elseif(TRAJOPT_CUDA STREQUAL "ON")
    message(FATAL_ERROR "TRAJOPT_CUDA is ON, but nvcc is neither on PATH, in CUDA_HOME nor in "
                        "/usr/local/cuda/bin; CMAKE_CUDA_COMPILER names one that lies elsewhere")
  else()
    message(STATUS "CUDA: no nvcc, the package gets the CPU backend only")
    return()
  endif()
endif()

# One binary for every GPU from Turing on that this compiler knows, and the newest of them also as
# PTX, which the driver translates for GPUs that came later.
if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES AND "$ENV{CUDAARCHS}" STREQUAL "")
  execute_process(
    COMMAND ${CMAKE_CUDA_COMPILER} --list-gpu-arch
    OUTPUT_VARIABLE known
    RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "${CMAKE_CUDA_COMPILER} --list-gpu-arch failed: ${failed}; "
                        "set CMAKE_CUDA_ARCHITECTURES, or TRAJOPT_CUDA=OFF")
  endif()
  set(architectures)
  foreach(architecture 75 80 86 89 90 100)
    if(known MATCHES "compute_${architecture}[\r\n]")
      list(APPEND architectures ${architecture}-real)
      set(newest ${architecture})
    endif()
  endforeach()
  if(NOT architectures)
    message(FATAL_ERROR "${CMAKE_CUDA_COMPILER} knows none of the architectures 75 to 100; "
                        "set CMAKE_CUDA_ARCHITECTURES, or TRAJOPT_CUDA=OFF")
  endif()
  list(APPEND architectures ${newest}-virtual)
  set(CMAKE_CUDA_ARCHITECTURES ${architectures})
endif()

enable_language(CUDA)
if(NOT CMAKE_CUDA_COMPILER_ID STREQUAL "NVIDIA" OR CMAKE_CUDA_COMPILER_VERSION VERSION_LESS 12.0)
  if(TRAJOPT_CUDA STREQUAL "ON")
    message(FATAL_ERROR "the CUDA backend needs nvcc 12.0 or newer (C++20), found "
                        "${CMAKE_CUDA_COMPILER_ID} ${CMAKE_CUDA_COMPILER_VERSION}")
  endif()
  message(STATUS "CUDA: ${CMAKE_CUDA_COMPILER_ID} ${CMAKE_CUDA_COMPILER_VERSION} has no C++20, "
                 "the package gets the CPU backend only")
  return()
endif()
# CMake before 3.26 does not know that nvcc has C++20.
if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)
  set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION -std=c++20)
  set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION -std=c++20)
endif()
find_package(CUDAToolkit REQUIRED)
set(TRAJOPT_WITH_CUDA ON)
set(TRAJOPT_WITH_EMULATION ON)
message(STATUS "CUDA: ${CMAKE_CUDA_COMPILER_VERSION} for ${CMAKE_CUDA_ARCHITECTURES}")
