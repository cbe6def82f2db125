# Compiler settings, and the helpers that every module, program and test uses.
include(GNUInstallDirs)

if(CAIRN_SANITIZE)
  set(CMAKE_BUILD_TYPE Sanitizer)  # without NDEBUG, so that CAIRN_DCHECK is on
endif()
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
# Hardened by what costs less than 2 % (tests/bench/README.md): a write beyond a buffer or an index out of range that the
# compiler's checks see ends the program (SIGABRT), since going on may be what somebody who made the input wants.
set(CMAKE_CXX_FLAGS_RELEASE
    "-O3 -DNDEBUG -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2 -D_GLIBCXX_ASSERTIONS -fstack-protector-strong")

# Sources of a module are compiled together: Eigen and the standard library are parsed once, which saves more than
# half of a full build's processor time. Without, a change to one file is built faster.
option(CAIRN_UNITY "Compile the sources of a module together" ON)
set(CMAKE_UNITY_BUILD ${CAIRN_UNITY})
set(CMAKE_UNITY_BUILD_BATCH_SIZE 24)

find_program(CAIRN_CCACHE ccache)
if(CAIRN_CCACHE)
  # Paths relative to the source tree: all work trees of one machine share the cache.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
      CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 CCACHE_SLOPPINESS=pch_defines,time_macros ${CAIRN_CCACHE})
endif()

# A program loads only the libraries that it uses: OpenCV's image codecs bring 130 others, 0.2 s at each start.
add_link_options(-Wl,--as-needed)
find_program(CAIRN_LLD ld.lld)
if(CAIRN_LLD)
  add_link_options(-fuse-ld=lld)
endif()

# No contraction into fused operations: the same source gives the same bytes on every x86-64.
# -Wrestrict has false positives on std::string in GCC 12 (its bug 105651).
add_compile_options(-Wall -Wextra -Wno-unused-parameter -Wno-restrict -ffp-contract=off)
# GCC 12 warns of uninitialized values in Eigen's decompositions that are none.
add_compile_options(-Wno-maybe-uninitialized)
# GCC looks for memory to free from some 2 GB on alone: a twelfth of the modules' processor time, for a fifth more memory.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options(--param=ggc-min-heapsize=1000000)
endif()
if(CAIRN_WERROR)
  add_compile_options(-Werror)
endif()
if(CAIRN_SANITIZE AND NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  message(FATAL_ERROR "CAIRN_SANITIZE needs CXX=clang++; scripts/run_sanitizers sets it")
endif()
if(CAIRN_SANITIZE STREQUAL "address")
  # Address and undefined, and the counters of coverage that guide libFuzzer (tests/fuzz); the first finding ends the program.
  # Left out are checks that cost most of the time to compile (a kernel of SIMD ten times as much) and say little: of null (a
  # crash anyway), of objects' sizes and pointers that wrap around (the address sanitizer sees their use), of virtual tables.
  # -O2, since Clang's -O1 inlines nothing of Eigen and takes as long to compile.
  add_compile_options(-O2 -fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow
    -fno-sanitize=null,object-size,pointer-overflow,vptr -fno-sanitize-recover=all -fno-omit-frame-pointer
    -Wno-unknown-warning-option)
  add_link_options(-fsanitize=address,undefined,float-cast-overflow)
elseif(CAIRN_SANITIZE STREQUAL "thread")
  add_compile_options(-O1 -fsanitize=thread -Wno-unknown-warning-option)
  add_link_options(-fsanitize=thread)
elseif(CAIRN_SANITIZE)
  message(FATAL_ERROR "CAIRN_SANITIZE is '${CAIRN_SANITIZE}'; use 'address' or 'thread'")
endif()
# Modules that read bytes of strangers. All others are without checks of alignment and without what tells the fuzzers which
# values are compared: both are for parsers, and slow down what computes.
set(cairn_parsers image depth database io)
set(cairn_no_parser "")
if(CAIRN_SANITIZE STREQUAL "address")
  set(cairn_no_parser -fno-sanitize-coverage=trace-cmp -fno-sanitize=alignment)
endif()

# Shared libraries, Python modules among them, can be made of it; functions are inlined as ever.
function(cairn_compile_as_module target)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE -fno-semantic-interposition)
endfunction()

# Headers that are parsed once, for all targets that reuse them.
function(cairn_precompile target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fpch-preprocess)  # ccache asks for it
  else()
    target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")  # the same
  endif()
  target_precompile_headers(${target} PRIVATE ${ARGN})
endfunction()
function(cairn_reuse_precompiled target headers)
  target_compile_options(${target} PRIVATE $<TARGET_PROPERTY:${headers},COMPILE_OPTIONS>)
  target_precompile_headers(${target} REUSE_FROM ${headers})
endfunction()

# cairn_module(NAME SOURCES a.cc ... [KERNELS k.cc ...] [APART b.cc ...] [PUBLIC lib ...] [PRIVATE lib ...])
# One static library cairn_NAME (alias cairn::NAME). Without SOURCES, a header-only library.
# KERNELS are sources that Highway compiles for every instruction set, each a translation unit. APART are sources that need
# libraries which most programs with this module do without.
function(cairn_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;KERNELS;APART;PUBLIC;PRIVATE" ${ARGN})
  if(ARG_SOURCES)
    add_library(cairn_${name} STATIC ${ARG_SOURCES} ${ARG_KERNELS} ${ARG_APART})
    set_source_files_properties(${ARG_KERNELS} ${ARG_APART} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    set(scope PUBLIC)
    target_link_libraries(cairn_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
    target_include_directories(cairn_${name} PRIVATE ${PROJECT_SOURCE_DIR}/src)
    cairn_compile_as_module(cairn_${name})
    cairn_reuse_precompiled(cairn_${name} cairn_module_headers)
    if(NOT name IN_LIST cairn_parsers)
      target_compile_options(cairn_${name} PRIVATE ${cairn_no_parser})
    endif()
  else()
    add_library(cairn_${name} INTERFACE)
    set(scope INTERFACE)
    target_link_libraries(cairn_${name} INTERFACE ${ARG_PUBLIC})
  endif()
  add_library(cairn::${name} ALIAS cairn_${name})
  target_compile_features(cairn_${name} ${scope} cxx_std_20)
  target_include_directories(cairn_${name} ${scope}
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  set_target_properties(cairn_${name} PROPERTIES EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY CAIRN_MODULES ${name})
  set_property(GLOBAL PROPERTY CAIRN_LINKS_${name} ${ARG_PUBLIC} ${ARG_PRIVATE})
endfunction()

# cairn_program(NAME SOURCES ... LIBS ...): an executable in build/bin, installed.
function(cairn_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()

# cairn_test(NAME SOURCES ... LIBS ... [LABELS unit|slow|data ...] [PROPERTIES ...]): one GoogleTest program;
# every test case is registered with ctest under the labels (default: unit), with these properties.
function(cairn_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS;LABELS;PROPERTIES" ${ARGN})
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${name} PRIVATE
    CAIRN_SHARED_DIR="${PROJECT_SOURCE_DIR}/../shared" CAIRN_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    CAIRN_BINARY_DIR="${CMAKE_BINARY_DIR}")
  target_compile_options(${name} PRIVATE ${cairn_no_parser})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} GTest::gmock_main)
  cairn_reuse_precompiled(${name} cairn_test_headers)  # tests/support
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 120
    PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT 600 ${ARG_PROPERTIES})
endfunction()
