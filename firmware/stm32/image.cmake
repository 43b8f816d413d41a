# What the chips' folders build an image from: shared_sources, and set_up_program(TARGET) for whatever is linked for
# the chip whose folder calls it.
set(shared "${CMAKE_CURRENT_LIST_DIR}")
set(shared_sources
  battery.c can_queue.c can_timing.c clock.c crystal.c debugger.c driver_enable.c encoders.c fault.c fault_entry.S
  flash_erase.c identity.c log_memory.c main.c motors.c startup.c supply.c usart_link.c watchdog.c)
list(TRANSFORM shared_sources PREPEND "${shared}/")
option(TRUING_DRIVER_ENABLE_ACTIVE_LOW "The motor drivers are on while their enable pin is low" OFF)

function(set_up_program target)
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/firmware" SUFFIX ".elf")
  target_include_directories(${target} PRIVATE . "${shared}")
  target_compile_definitions(${target} PRIVATE
    "TRUING_VERSION=\"${PROJECT_VERSION}\""
    "TRUING_BOARD_HEADER=\"boards/${TRUING_BOARD}.h\""
    "DRIVER_ENABLE_ACTIVE_LOW=$<BOOL:${TRUING_DRIVER_ENABLE_ACTIVE_LOW}>")
  target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:C>:-Wdouble-promotion>)
  target_link_options(${target} PRIVATE
    -nostartfiles --specs=nano.specs
    "-Wl,-Map=${CMAKE_BINARY_DIR}/firmware/${target}.map,--gc-sections,--fatal-warnings,--no-undefined")
endfunction()
