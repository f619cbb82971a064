# Installs the build into a fresh prefix, builds the example against it, runs it, and looks at what it prints.
#   cmake -DBUILD=build/release -DSOURCE=tests/consumer -DWORK=folder [-DSANITIZE=address,undefined] -P check.cmake
set(flags "")
if(SANITIZE)
  set(flags -fsanitize=${SANITIZE}) # the archive was built so, and cannot be linked without
endif()
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}: ${code}\n${output}${errors}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} -G Ninja -S ${SOURCE} -B ${WORK}/build -DCMAKE_PREFIX_PATH=${WORK}/prefix
    -DCMAKE_BUILD_TYPE=Release "-DCMAKE_CXX_FLAGS=${flags}")
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/consumer)
message("${output}")
# Wiscombe's MIEV0 and others agree on these digits for x = 10, m = 1.5.
if(NOT output MATCHES "Qext 2\\.88199")
  message(FATAL_ERROR "the sphere's extinction is not 2.88199...")
endif()
# Alexander's dark band ends and the primary bow stands between 130 and 150 deg.
if(NOT output MATCHES "brightest between 130 and 150 deg at 1(3[7-9]|4[0-4]) deg, [0-9]+\\.[0-9]+ per steradian")
  message(FATAL_ERROR "the drop's rainbow is not where it should be")
endif()
run(${WORK}/prefix/bin/scatter --version)
