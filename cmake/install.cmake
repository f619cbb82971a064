# cmake --install: the program, the library with its headers, and the CMake package that find_package(scatter) finds.
include(CMakePackageConfigHelpers)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/scatter)
install(TARGETS scatter_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(
  TARGETS scatter
  EXPORT scatter-targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(
  DIRECTORY libscatter/
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/scatter
  FILES_MATCHING
  PATTERN "*.hpp")
install(EXPORT scatter-targets NAMESPACE scatter:: DESTINATION ${package_folder})
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

# A consumer must find what the archive links to. The list is read off the target itself, so it cannot go stale;
# each imported target is named with the package that makes it.
set(package_of_OpenCL::OpenCL OpenCL)
set(package_of_OpenCL::HeadersCpp "OpenCLHeadersCpp")
set(package_of_embree "embree 3")
set(package_of_FFTW3::fftw3 FFTW3)
set(package_of_OpenEXR::OpenEXR OpenEXR)
set(package_of_Imath::Imath Imath)
set(package_of_netCDF::netcdf netCDF)
set(package_of_nlohmann_json::nlohmann_json nlohmann_json)
set(package_of_fmt::fmt fmt)
set(package_of_spdlog::spdlog spdlog)
set(package_of_glm::glm glm)
set(package_of_Threads::Threads Threads)
get_target_property(links scatter LINK_LIBRARIES)
set(SCATTER_FIND_DEPENDENCIES "")
foreach(link IN LISTS links)
  if(link MATCHES "^::@" OR link MATCHES "^\\$<BUILD_INTERFACE:" OR link MATCHES "^(m|rt|dl|pthread)$")
    continue()
  endif()
  if(NOT DEFINED package_of_${link})
    message(FATAL_ERROR "cmake/install.cmake does not say which package makes ${link}")
  endif()
  string(APPEND SCATTER_FIND_DEPENDENCIES "find_dependency(${package_of_${link}})\n")
endforeach()

configure_package_config_file(cmake/scatter-config.cmake.in ${PROJECT_BINARY_DIR}/scatter-config.cmake
                              INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/scatter-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/scatter-config.cmake ${PROJECT_BINARY_DIR}/scatter-config-version.cmake
              cmake/FindFFTW3.cmake
        DESTINATION ${package_folder})
