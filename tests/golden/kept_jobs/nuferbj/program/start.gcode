; print program of nuferbj, dialect nuferbj 1
G21
G90
M810 L2 N128 W1011 K1 Q96944.340
