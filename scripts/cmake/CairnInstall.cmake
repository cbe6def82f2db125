# `cmake --install` gives the programs, the libraries, the headers, and a package for find_package(cairn).
include(CMakePackageConfigHelpers)

get_property(modules GLOBAL PROPERTY CAIRN_MODULES)
install(TARGETS ${modules} EXPORT cairnTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/cairn DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
install(EXPORT cairnTargets NAMESPACE cairn:: DESTINATION ${package_dir})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/cairnConfig.cmake.in
  ${CMAKE_BINARY_DIR}/cairnConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/cairnConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/cairnConfig.cmake ${CMAKE_BINARY_DIR}/cairnConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindVLFeat.cmake ${CMAKE_CURRENT_LIST_DIR}/FindCHOLMOD.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindLensfun.cmake ${CMAKE_CURRENT_LIST_DIR}/CairnPackages.cmake
        DESTINATION ${package_dir})
