# One interface target carries how we compile, so that no folder sets flags of its own.
add_library(scatter_options INTERFACE)
target_compile_options(
  scatter_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
                            $<$<BOOL:${SCATTER_WARNINGS_AS_ERRORS}>:-Werror>)
# Nothing here reads errno or floating-point traps; without them loops vectorise and stay IEEE-exact otherwise.
target_compile_options(scatter_options INTERFACE -fno-math-errno -fno-trapping-math)
if(SCATTER_SANITIZE)
  target_compile_options(scatter_options INTERFACE -fsanitize=${SCATTER_SANITIZE} -fno-omit-frame-pointer
                                                   -fno-sanitize-recover=all)
  # GCC's own library looks uninitialised to it once sanitizers have changed the code; the sanitizers see better.
  target_compile_options(scatter_options INTERFACE "$<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>")
  target_link_options(scatter_options INTERFACE -fsanitize=${SCATTER_SANITIZE})
endif()

# What only drives the library, programs and tests, spends its time there: half the time to compile is worth more.
add_library(scatter_driver_options INTERFACE)
target_link_libraries(scatter_driver_options INTERFACE scatter_options)
target_compile_options(scatter_driver_options INTERFACE $<$<CONFIG:Release>:-O1>)
